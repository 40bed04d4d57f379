// Many drives of the car of seven degrees of freedom, each with its own speed, mass and tyres; one array a state.
//
// A pack of runs stays in registers and the nearest cache from the first step to the last; only saved rows go to memory.
#include <algorithm>
#include <vector>
#include "seven_dof.hpp"

namespace {

struct Problem {
  int runs, rows, steps_a_row;
  double step;
  const double *body;      // the fields of Body, in order
  const double *own;       // (5, runs): the fields of Own
  const double *start;     // (runs,): speed
  const double *steering;  // (2 rows steps_a_row + 1): at every half step
};

template <class S> Body<S> body_of(const Problem &p) {
  Body<S> body;
  S fields[sizeof(Body<S>) / sizeof(S)];
  for (std::size_t i = 0; i < std::size(fields); i++) fields[i] = S(p.body[i]);
  std::memcpy(&body, fields, sizeof body);
  return body;
}

template <class S> std::vector<Steered<S>> steered(const Problem &p) {
  std::vector<Steered<S>> made(2 * std::size_t(p.rows) * p.steps_a_row + 1);
  for (std::size_t k = 0; k < made.size(); k++) made[k] = {S(std::cos(p.steering[k])), S(std::sin(p.steering[k]))};
  return made;
}

// `save(row, x)` gets every `steps_a_row`-th state.
template <class P, class S, class Save>
INLINE void drive(P speed, const Own<P> &own, const Body<S> &body, const std::vector<Steered<S>> &steer, const Problem &p, Save save) {
  P x[car_states];
  for (auto &value : x) value = P(S(0));
  x[v_x] = speed;
  for (int i = spin_fl; i <= spin_rr; i++) x[i] = speed * P(1 / body.radius);
  const P inverse_mass = P(S(1)) / own.mass;
  const Steered<S> *now = steer.data();
  for (int row = 0; row < p.rows; row++) {
    for (int k = 0; k < p.steps_a_row; k++, now += 2) runge_kutta(x, own, inverse_mass, body, now, S(p.step));
    save(row, x);
  }
}

// `found` is (car_states, rows, runs).
template <class S> void many(const Problem &p, S *found) {
  // Three native vectors at once; see vector.hpp. Two take 1.17 times as long, four 1.07 to 2.5 times.
  using P = Pack<S, 3>;
  const auto body = body_of<S>(p);
  const auto steer = steered<S>(p);
  for (int at = 0; at < p.runs; at += P::lanes) {
    const int present = std::min(P::lanes, p.runs - at);
    const auto lanes_of = [&](const double *values) {
      S some[P::lanes];
      // The last pack repeats its last run.
      for (int l = 0; l < P::lanes; l++) some[l] = S(values[at + std::min(l, present - 1)]);
      return P::load(some);
    };
    const double *o = p.own;
    const int n = p.runs;
    const Own<P> own{lanes_of(o), lanes_of(o + n), lanes_of(o + 2 * n), lanes_of(o + 3 * n), lanes_of(o + 4 * n)};
    drive(lanes_of(p.start), own, body, steer, p, [&](int row, const P *x) {
      for (int i = 0; i < car_states; i++)
        std::memcpy(found + (std::size_t(i) * p.rows + row) * p.runs + at, x[i].v, present * sizeof(S));
    });
  }
}

void one(const Problem &p, double *found) {
  const Own<double> own{p.own[0], p.own[1], p.own[2], p.own[3], p.own[4]};
  drive(p.start[0], own, body_of<double>(p), steered<double>(p), p, [&](int row, const double *x) {
    for (int i = 0; i < car_states; i++) found[std::size_t(i) * p.rows + row] = x[i];
  });
}

}  // namespace

// `found` is (8, rows, runs): v_x, v_y, yaw, yaw rate and the four spins at the end of each row.
extern "C" void jaxveh_seven_dof(int single, const Problem *problem, void *found) {
  if (single) many<float>(*problem, static_cast<float *>(found));
  else if (problem->runs == 1) one(*problem, static_cast<double *>(found));
  else many<double>(*problem, static_cast<double *>(found));
}
