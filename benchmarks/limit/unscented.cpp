// Unscented Kalman filter of speed, mass and road grade; the speed is measured.
//
//   dv/dt = torque / (r M) - g f cos(grade) - g sin(grade) - k v^2 / M,   M and grade walk at random
//
// Scaled weights, a Runge-Kutta step for every sigma point, points drawn again before the measurement. Two forms: many runs
// are lanes of a pack, and for one run the seven sigma points are.
#include <cmath>
#include <vector>
#include "elementary.hpp"

namespace {

constexpr int dims = 3;

struct Problem {
  int runs, rows;
  const double *torque;     // (rows,)
  const void *speed;        // (rows, runs), float or double
  const double *truck;      // wheel radius, gravity, rolling resistance, drag 0.5 rho c_d A, step
  const double *prior_mean, *prior_std, *process_std, *sensor_std;
  const double *spread;     // alpha, beta, kappa
};

// Lower triangle of a symmetric matrix, or a triangular factor, row by row.
template <class T> struct Triangle {
  T a[6];
  INLINE T &operator()(int i, int j) { return a[i * (i + 1) / 2 + j]; }
  INLINE const T &operator()(int i, int j) const { return a[i * (i + 1) / 2 + j]; }
};
template <class T> struct Belief { T mean[dims]; Triangle<T> cov; };

template <class S> struct Settings {
  S inverse_radius, gravity, rolling, drag, step, process_variance[dims], sensor_variance;
  S reach, centre_mean, centre_cov, weight;  // of the sigma points: sqrt(n + lambda) and their weights
  explicit Settings(const Problem &p) {
    inverse_radius = S(1 / p.truck[0]), gravity = S(p.truck[1]), rolling = S(p.truck[2]), drag = S(p.truck[3]), step = S(p.truck[4]);
    for (int i = 0; i < dims; i++) process_variance[i] = S(p.process_std[i] * p.process_std[i]);
    sensor_variance = S(p.sensor_std[0] * p.sensor_std[0]);
    const double alpha = p.spread[0], beta = p.spread[1], kappa = p.spread[2], scaled = alpha * alpha * (dims + kappa);
    reach = S(std::sqrt(scaled)), weight = S(0.5 / scaled);
    centre_mean = S(1 - dims / scaled), centre_cov = S(1 - dims / scaled + 1 - alpha * alpha + beta);
  }
};

INLINE double root(double x) { return std::sqrt(x); }
INLINE float root(float x) { return std::sqrt(x); }
template <class S, int K> INLINE Pack<S, K> root(Pack<S, K> x) { return square_root(x); }

// Cholesky factor by way of L D L': the roots are then outside the chain of dependent divisions.
template <class T> INLINE Triangle<T> cholesky(const Triangle<T> &c) {
  Triangle<T> l;
  const T one(1), inverse_0 = one / c(0, 0);
  const T l10 = c(1, 0) * inverse_0, l20 = c(2, 0) * inverse_0;
  const T d1 = c(1, 1) - l10 * c(1, 0), e21 = c(2, 1) - l20 * c(1, 0), l21 = e21 / d1;
  const T d2 = c(2, 2) - l20 * c(2, 0) - l21 * e21, r0 = root(c(0, 0)), r1 = root(d1);
  l(0, 0) = r0, l(1, 0) = l10 * r0, l(2, 0) = l20 * r0, l(1, 1) = r1, l(2, 1) = l21 * r1, l(2, 2) = root(d2);
  return l;
}

// The speed after one step, for a pack of points.
template <class P> INLINE P propagate(P v, P mass, P grade, P torque, const Settings<scalar_of<P>> &s) {
  using S = scalar_of<P>;
  P sine, cosine, inverse_mass = P(1) / mass;
  sine_cosine(grade, sine, cosine);
  const P half(s.step / 2), whole(s.step), sixth(s.step / 6);
  const P drive = torque * P(s.inverse_radius) * inverse_mass - P(s.gravity * s.rolling) * cosine - P(s.gravity) * sine;
  const P drag = P(s.drag) * inverse_mass;
  auto slope = [&](P x) { return drive - drag * (x * x); };
  P k1 = slope(v), k2 = slope(v + half * k1), k3 = slope(v + half * k2), k4 = slope(v + whole * k3);
  return v + sixth * (k1 + P(S(2)) * (k2 + k3) + k4);
}

template <class T> struct Update { T innovation, variance; };

// Kalman's correction from the predicted measurement's moments.
template <class T> INLINE void correct(Belief<T> &b, const T (&cross)[dims], T variance, T innovation) {
  const T inverse = T(1) / variance;
  for (int i = 0; i < dims; i++) {
    const T gain = cross[i] * inverse;
    b.mean[i] = b.mean[i] + gain * innovation;
    for (int j = 0; j <= i; j++) b.cov(i, j) = b.cov(i, j) - gain * cross[j];
  }
}

// ---- many runs: a lane a run. With weightless centre points (alpha^2 (n + kappa) = n and beta = alpha^2 - 1) they are left out.
template <class P, bool Centre> struct Lanes {
  using S = scalar_of<P>;
  static constexpr int first = Centre ? 0 : 1, points = 1 + 2 * dims;

  struct Points { P x[points][dims]; };

  static INLINE Points draw(const Belief<P> &b, const Settings<S> &s) {
    const Triangle<P> l = cholesky(b.cov);
    Points q;
#pragma GCC unroll 8
    for (int p = 0; p < points; p++)
      for (int i = 0; i < dims; i++) q.x[p][i] = b.mean[i];
    for (int j = 0; j < dims; j++)
      for (int i = j; i < dims; i++) {
        const P shift = l(i, j) * P(s.reach);
        q.x[1 + j][i] = b.mean[i] + shift;
        q.x[1 + dims + j][i] = b.mean[i] - shift;
      }
    return q;
  }
  // Weighted sum over the points of a function of the point's number.
  template <class F> static INLINE P over(P centre, const Settings<S> &s, F value) {
    P sum = value(1);
#pragma GCC unroll 8
    for (int p = 2; p < points; p++) sum += value(p);
    sum *= P(s.weight);
    return Centre ? sum + centre * value(0) : sum;
  }
  static INLINE P average(const Points &q, int i, const Settings<S> &s) {
    return over(P(s.centre_mean), s, [&](int p) { return q.x[p][i]; });
  }
  static INLINE void predict(Belief<P> &b, P torque, const Settings<S> &s) {
    Points q = draw(b, s);
#pragma GCC unroll 8
    for (int p = first; p < points; p++) q.x[p][0] = propagate(q.x[p][0], q.x[p][1], q.x[p][2], torque, s);
    for (int i = 0; i < dims; i++) b.mean[i] = average(q, i, s);
#pragma GCC unroll 8
    for (int p = first; p < points; p++)
      for (int i = 0; i < dims; i++) q.x[p][i] = q.x[p][i] - b.mean[i];
    for (int i = 0; i < dims; i++)
      for (int j = 0; j <= i; j++) {
        b.cov(i, j) = over(P(s.centre_cov), s, [&](int p) { return q.x[p][i] * q.x[p][j]; });
        if (i == j) b.cov(i, j) += P(s.process_variance[i]);
      }
  }
  static INLINE Update<P> update(Belief<P> &b, P measured, const Settings<S> &s) {
    const Points q = draw(b, s);
    const P expected = average(q, 0, s), innovation = measured - expected;
    auto deviation = [&](int p) { return q.x[p][0] - expected; };
    const P variance = over(P(s.centre_cov), s, [&](int p) { return deviation(p) * deviation(p); }) + P(s.sensor_variance);
    P cross[dims];
    for (int i = 0; i < dims; i++)
      cross[i] = over(P(s.centre_cov), s, [&](int p) { return deviation(p) * (q.x[p][i] - b.mean[i]); });
    correct(b, cross, variance, innovation);
    return {innovation, variance};
  }
};

template <class S> void start(Belief<S> &b, const Problem &p) {
  for (int i = 0; i < dims; i++) {
    b.mean[i] = S(p.prior_mean[i]);
    for (int j = 0; j <= i; j++) b.cov(i, j) = i == j ? S(p.prior_std[i] * p.prior_std[i]) : S(0);
  }
}

// Copies `count` lanes; a whole pack is one load or store, where a copy of variable length would be a call.
template <class P> INLINE void copy_lanes(void *to, const void *from, int count) {
  if (__builtin_expect(count == P::lanes, 1)) std::memcpy(to, from, sizeof(P));
  else std::memcpy(to, from, count * sizeof(scalar_of<P>));
}

// mean is (rows, 3, runs), log_likelihood (runs,). Time is the outer loop, so that memory is read and written in order.
template <class S, bool Centre> void many(const Problem &p, S *mean, S *log_likelihood) {
  using P = Pack<S, 1>;
  using Filter = Lanes<P, Centre>;
  const Settings<S> s(p);
  const int runs = p.runs, blocks = (runs + P::lanes - 1) / P::lanes;
  Belief<S> prior;
  start(prior, p);
  Belief<P> initial;
  for (int i = 0; i < dims; i++) initial.mean[i] = P(prior.mean[i]);
  for (int i = 0; i < 6; i++) initial.cov.a[i] = P(prior.cov.a[i]);
  std::vector<Belief<P>> beliefs(blocks, initial);
  std::vector<P> logs(blocks, P(0));
  const P constant(S(std::log(2 * M_PI)));
  for (int k = 0; k < p.rows; k++)
    for (int block = 0; block < blocks; block++) {
      const int at = block * P::lanes, present = std::min(P::lanes, runs - at);
      Belief<P> b = beliefs[block];
      if (k) Filter::predict(b, P(S(p.torque[k - 1])), s);
      P measured(10);
      copy_lanes<P>(&measured, static_cast<const S *>(p.speed) + std::size_t(k) * runs + at, present);
      const Update<P> u = Filter::update(b, measured, s);
      logs[block] += P(S(-0.5)) * (u.innovation * u.innovation / u.variance + logarithm(u.variance) + constant);
      for (int i = 0; i < dims; i++) copy_lanes<P>(mean + (std::size_t(k) * dims + i) * runs + at, &b.mean[i], present);
      beliefs[block] = b;
    }
  for (int block = 0; block < blocks; block++) {
    const int at = block * P::lanes;
    copy_lanes<P>(log_likelihood + at, &logs[block], std::min(P::lanes, runs - at));
  }
}

// ---- one run: a lane a sigma point (the last lanes have weight zero), linear algebra in scalars.
template <class S> class Single {
  static constexpr int parts = std::max(1, 8 / Native<S>::lanes);
  using P = Pack<S, parts>;
  const Settings<S> s;
  P mean_weight, cov_weight, direction[dims];
  Belief<S> b;

  static INLINE void set(P &x, int lane, S value) { x.v[lane / Native<S>::lanes][lane % Native<S>::lanes] = value; }

  INLINE void draw(P (&x)[dims]) const {
    const Triangle<S> l = cholesky(b.cov);
    for (int i = 0; i < dims; i++) {
      x[i] = P(b.mean[i]);
      for (int j = 0; j <= i; j++) x[i] += P(l(i, j)) * direction[j];
    }
  }
  // The first eight lanes, added in a tree.
  static INLINE S total(P x) {
    typedef S Eight __attribute__((vector_size(8 * sizeof(S))));
    typedef S Four __attribute__((vector_size(4 * sizeof(S))));
    typedef S Two __attribute__((vector_size(2 * sizeof(S))));
    Eight e;
    std::memcpy(&e, x.v, sizeof e);
    Four f = __builtin_shufflevector(e, e, 0, 1, 2, 3) + __builtin_shufflevector(e, e, 4, 5, 6, 7);
    Two t = __builtin_shufflevector(f, f, 0, 1) + __builtin_shufflevector(f, f, 2, 3);
    return t[0] + t[1];
  }

public:
  explicit Single(const Problem &p) : s(p), mean_weight(0), cov_weight(0) {
    for (auto &d : direction) d = P(0);
    set(mean_weight, 0, s.centre_mean), set(cov_weight, 0, s.centre_cov);
    for (int j = 0; j < dims; j++)
      for (int lane : {1 + j, 1 + dims + j}) {
        set(mean_weight, lane, s.weight), set(cov_weight, lane, s.weight);
        set(direction[j], lane, lane <= dims ? s.reach : -s.reach);
      }
    start(b, p);
  }
  INLINE void predict(S torque) {
    P x[dims];
    draw(x);
    x[0] = propagate(x[0], x[1], x[2], P(torque), s);
    for (int i = 0; i < dims; i++) {
      b.mean[i] = total(mean_weight * x[i]);
      x[i] = x[i] - P(b.mean[i]);
    }
    for (int i = 0; i < dims; i++)
      for (int j = 0; j <= i; j++) b.cov(i, j) = total(cov_weight * x[i] * x[j]) + (i == j ? s.process_variance[i] : S(0));
  }
  INLINE Update<S> update(S measured) {
    P x[dims];
    draw(x);
    const S expected = total(mean_weight * x[0]), innovation = measured - expected;
    const P deviation = x[0] - P(expected), weighted = cov_weight * deviation;
    const S variance = total(weighted * deviation) + s.sensor_variance;
    S cross[dims];
    for (int i = 0; i < dims; i++) cross[i] = total(weighted * (x[i] - P(b.mean[i])));
    correct(b, cross, variance, innovation);
    return {innovation, variance};
  }
  const S *mean() const { return b.mean; }
};

template <class S> void one(const Problem &p, S *mean, S *log_likelihood) {
  using P = Pack<S, 1>;
  Single<S> filter(p);
  // The logarithms of all rows are taken at the end, a vector at a time, outside the chain of the recursion.
  const int padded = (p.rows + P::lanes - 1) / P::lanes * P::lanes;
  std::vector<S> variances(padded, S(1));
  double squares = 0, logs = 0;
  const S *speed = static_cast<const S *>(p.speed);
  for (int k = 0; k < p.rows; k++) {
    if (k) filter.predict(S(p.torque[k - 1]));
    const Update<S> u = filter.update(speed[k]);
    variances[k] = u.variance;
    squares += u.innovation * u.innovation / u.variance;
    std::memcpy(mean + std::size_t(k) * dims, filter.mean(), dims * sizeof(S));
  }
  for (int k = 0; k < padded; k += P::lanes) logs += sum_of_lanes(logarithm(P::load(&variances[k])));
  *log_likelihood = S(-0.5 * (squares + logs + p.rows * std::log(2 * M_PI)));
}

template <class S> void run(const Problem &p, void *mean, void *log_likelihood) {
  S *m = static_cast<S *>(mean), *l = static_cast<S *>(log_likelihood);
  const Settings<S> s(p);
  if (p.runs == 1) one<S>(p, m, l);
  else if (s.centre_mean == 0 && s.centre_cov == 0) many<S, false>(p, m, l);
  else many<S, true>(p, m, l);
}

}  // namespace

extern "C" void jaxveh_unscented(int single, const Problem *problem, void *mean, void *log_likelihood) {
  single ? run<float>(*problem, mean, log_likelihood) : run<double>(*problem, mean, log_likelihood);
}
