// Bootstrap and auxiliary particle filter of the single track, systematic resampling before every step.
//
// The particles are a structure of arrays, one array a state. Both filters walk over them a pack at a time and keep a particle
// in registers from the gather of its ancestor to its log-likelihood, so each step touches memory twice.
#include <cmath>
#include <cstdlib>
#include <memory>
#include <utility>
#include <vector>
#include "random.hpp"
#include "resampling.hpp"
#include "single_track.hpp"

namespace {

template <class T> struct Freed { void operator()(T *p) const { std::free(p); } };
template <class T> using Buffer = std::unique_ptr<T[], Freed<T>>;

// Zeroed, 64-byte aligned, with room for loads and stores that run over the end.
template <class T> Buffer<T> buffer(int n) {
  const std::size_t bytes = ((n + 64) * sizeof(T) + 63) / 64 * 64;
  T *p = static_cast<T *>(std::aligned_alloc(64, bytes));
  std::memset(p, 0, bytes);
  return Buffer<T>(p);
}

struct Problem {
  int particles, rows;
  const double *steer, *speed, *yaw_rate, *lateral_acceleration;          // (rows,)
  const double *car, *prior_mean, *prior_std, *process_std, *sensor_std;  // car: mass, inertia, front, rear, step
};

// Sums of weights and weighted states, relative to exp(reference). The reference grows with the largest log-weight met so
// far, so that nothing overflows and no second pass is needed.
template <class P> struct WeightedMean {
  using S = scalar_of<P>;
  S reference = std::numeric_limits<S>::lowest() / 4;
  P weight{0}, state[states];
  WeightedMean() { for (auto &s : state) s = P(0); }

  INLINE void add(P log_weight, const P *x) {
    if (__builtin_expect(any_above(log_weight, reference), 0)) raise(max_of_lanes(log_weight));
    P w = exponential(log_weight - P(reference));
    weight += w;
    for (int i = 0; i < states; i++) state[i] += w * x[i];
  }
  [[gnu::noinline]] void raise(S to) {
    const P factor(reference < S(-1e30) ? S(0) : S(std::exp(double(reference) - double(to))));
    reference = to;
    weight *= factor;
    for (auto &s : state) s *= factor;
  }
  double log_total() const { return std::log(sum_of_lanes(weight)) + reference; }
  void write(double *mean) const {
    const double total = sum_of_lanes(weight);
    for (int i = 0; i < states; i++) mean[i] = sum_of_lanes(state[i]) / total;
  }
};

template <class S> class ParticleFilter {
  // Two native vectors at once; see vector.hpp.
  using P = Pack<S, 2>;
  using One = Pack<S, 1>;
  static constexpr S nothing = std::numeric_limits<S>::lowest() / 8;  // log-weight of the places after the last particle

  const Problem &problem;
  const int n, padded;
  Car<S> car;
  Sensors<S> sensors;
  S process_std[states];
  Normals<S> normals;
  Buffer<S> now[states], next[states], log_weight, look_ahead, sums;
  Buffer<int32_t> bounds, ancestors;

public:
  ParticleFilter(const Problem &p, uint64_t seed)
      : problem(p), n(p.particles), padded((n + P::lanes - 1) / P::lanes * P::lanes), normals(seed),
        log_weight(buffer<S>(padded)), look_ahead(buffer<S>(padded)), sums(buffer<S>(padded)),
        bounds(buffer<int32_t>(padded)), ancestors(buffer<int32_t>(padded)) {
    car = {S(p.car[0]), S(p.car[1]), S(p.car[2]), S(p.car[3]), S(p.car[4])};
    const double s_r = p.sensor_std[0], s_a = p.sensor_std[1];
    sensors = {S(s_r), S(s_a), S(-std::log(2 * M_PI * s_r * s_a))};
    for (int i = 0; i < states; i++) {
      process_std[i] = S(p.process_std[i]);
      now[i] = buffer<S>(padded), next[i] = buffer<S>(padded);
    }
  }

  // Returns the log-likelihood of all rows; mean is (rows, states).
  double run(bool auxiliary, double *mean) {
    double total = first_row(mean);
    for (int k = 1; k < problem.rows; k++) {
      double *row_mean = mean + std::ptrdiff_t(k) * states;
      total += auxiliary ? auxiliary_step(k, row_mean) : bootstrap_step(k, row_mean);
    }
    return total;
  }

private:
  Input<S> input(int k) const {
    return {S(problem.steer[k]), S(std::cos(problem.steer[k])), S(problem.speed[k])};
  }
  INLINE P weigh(const P *x, int k, const Input<S> &u) const {
    return log_likelihood(x, car, u, sensors, S(problem.yaw_rate[k]), S(problem.lateral_acceleration[k]));
  }
  // Log-weights of the places after the last particle become negligible.
  INLINE void cut_tail(S *log_weights) const { for (int j = n; j < padded; j++) log_weights[j] = nothing; }
  INLINE P cut_tail(P log_weights, int j) const {
    if (__builtin_expect(j + P::lanes > n, 0))
      for (int l = std::max(n - j, 0); l < P::lanes; l++) log_weights.v[l / One::lanes][l % One::lanes] = nothing;
    return log_weights;
  }
  INLINE void add_noise(P *x) {
    for (int i = 0; i < states; i++) x[i] += P(process_std[i]) * normals.pair();
  }

  // The prior, weighted by the first measurement.
  double first_row(double *mean) {
    const Input<S> u = input(0);
    WeightedMean<P> average;
    for (int j = 0; j < padded; j += P::lanes) {
      P x[states];
      for (int i = 0; i < states; i++) {
        x[i] = P(S(problem.prior_mean[i])) + P(S(problem.prior_std[i])) * normals.pair();
        x[i].store(&now[i][j]);
      }
      P l = cut_tail(weigh(x, 0, u), j);
      l.store(&log_weight[j]);
      average.add(l, x);
    }
    average.write(mean);
    largest = average.reference;
    weight_total = average.log_total();
    return weight_total - std::log(n);
  }

  // Ancestors of all particles from log-weights whose largest is `largest`; returns log sum exp(log_weights).
  double resample(const S *log_weights, S largest) {
    One carry(0);
    for (int j = 0; j < padded; j += One::lanes) {
      One sum = running_sum(exponential(One::load(log_weights + j) - One(largest))) + carry;
      sum.store(&sums[j]);
      carry = One(sum.v[0][One::lanes - 1]);
    }
    const S total = carry.v[0][0];
    offspring_bounds(sums.get(), padded, S(n) / total, normals.uniform(), bounds.get());
    fill_ancestors(bounds.get(), n, ancestors.get());
    for (int j = n; j < padded; j++) ancestors[j] = ancestors[n - 1];
    return std::log(double(total)) + largest;
  }

  double bootstrap_step(int k, double *mean) {
    resample(log_weight.get(), largest);
    const Input<S> before = input(k - 1), u = input(k);
    WeightedMean<P> average;
    for (int j = 0; j < padded; j += P::lanes) {
      const Gather<P> from(&ancestors[j]);
      P x[states];
      for (int i = 0; i < states; i++) x[i] = from(now[i].get());
      propagate(x, car, before);
      add_noise(x);
      P l = cut_tail(weigh(x, k, u), j);
      l.store(&log_weight[j]);
      for (int i = 0; i < states; i++) x[i].store(&next[i][j]);
      average.add(l, x);
    }
    largest = average.reference;
    std::swap(now, next);
    average.write(mean);
    return average.log_total() - std::log(n);
  }

  // The look-ahead is the transition's mean: the state propagated without noise.
  double auxiliary_step(int k, double *mean) {
    const Input<S> before = input(k - 1), u = input(k);
    P top(nothing);
    for (int j = 0; j < padded; j += P::lanes) {
      P x[states];
      for (int i = 0; i < states; i++) x[i] = P::load(&now[i][j]);
      propagate(x, car, before);
      P ahead = weigh(x, k, u), l = cut_tail(ahead + P::load(&log_weight[j]), j);
      top = maximum(top, l);
      ahead.store(&look_ahead[j]);
      l.store(&log_weight[j]);
      for (int i = 0; i < states; i++) x[i].store(&next[i][j]);
    }
    const double first_stage = resample(log_weight.get(), max_of_lanes(top));
    WeightedMean<P> average;
    for (int j = 0; j < padded; j += P::lanes) {
      const Gather<P> from(&ancestors[j]);
      P x[states];
      for (int i = 0; i < states; i++) x[i] = from(next[i].get());
      add_noise(x);
      P l = cut_tail(weigh(x, k, u) - from(look_ahead.get()), j);
      l.store(&log_weight[j]);
      for (int i = 0; i < states; i++) x[i].store(&now[i][j]);
      average.add(l, x);
    }
    average.write(mean);
    // p(y_k | y_1..k-1) = (sum of normalised weights times look-ahead) (mean of second-stage weights).
    const double second_stage = average.log_total(), increment = first_stage - weight_total + second_stage - std::log(n);
    weight_total = second_stage;
    return increment;
  }

  double weight_total = 0;  // log of the sum of the current weights
  S largest = 0;            // and their largest logarithm
};

template <class S> double run(const Problem &p, int auxiliary, uint64_t seed, double *mean) {
  return ParticleFilter<S>(p, seed).run(auxiliary, mean);
}

}  // namespace

extern "C" double jaxveh_particle_filter(int single, int auxiliary, uint64_t seed, const Problem *problem, double *mean) {
  return single ? run<float>(*problem, auxiliary, seed, mean) : run<double>(*problem, auxiliary, seed, mean);
}
