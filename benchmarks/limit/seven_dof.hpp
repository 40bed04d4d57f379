// The car of seven degrees of freedom with quasi-static loads and a Magic Formula of the slip vector: the equations of
// jaxveh.vehicles.SevenDOF and jaxveh.tyres.IsotropicMagicFormula, written for a pack of runs or for one.
#pragma once
#include "scalar.hpp"

enum CarState { v_x, v_y, heading, turning, spin_fl, spin_fr, spin_rl, spin_rr, car_states };

// What all runs share. Torques are those of one wheel.
template <class S> struct Body {
  S yaw_inertia, front, rear, track_front, track_rear, height, radius, wheel_inertia, drag, rolling, shape, curvature;
  S torque_front, torque_rear;
};

// What each run has for itself.
template <class P> struct Own { P mass, stiffness_front, friction_front, stiffness_rear, friction_rear; };

template <class S> struct Steered { S cosine, sine; };

inline constexpr double gravity = 9.80665, crawl = 3, least_slip = 1e-5, standstill = 15.0 / 16;

// |v|, smooth below the crawl speed.
template <class P> INLINE P regularised(P v) {
  using S = lane_of<P>;
  const P size = absolute(v), s = minimum(size * P(S(1 / crawl)), P(S(1))), square = s * s;
  return select(size > P(S(crawl)), size, P(S(crawl / 8)) * (P(S(3)) + square * (P(S(6)) - square)));
}

// -1 ... 1: the direction that rolling resistance pushes against.
template <class P> INLINE P opposing(P v) {
  using S = lane_of<P>;
  const P s = maximum(minimum(v * P(S(1 / standstill)), P(S(1))), P(S(-1))), square = s * s;
  return s * (P(S(1.875)) + square * (P(S(0.375)) * square - P(S(1.25))));
}

// Half an axle's load, and what moves from its left to its right wheel.
template <class P> struct Axle {
  P half, moved;
  INLINE Axle(P load, P wish) : half(load * P(lane_of<P>(0.5))), moved(maximum(minimum(wish, half), P(lane_of<P>(0)) - half)) {}
};

template <class P> struct Pushed { P F_x, F_y, spin_rate; };

// Forces in the car's axes of a wheel that is turned by the steer, or not.
template <bool Turned, class P, class S>
INLINE Pushed<P> wheel(P u, P v, P omega, P load, P stiffness, P friction, S torque, const Body<S> &body, Steered<S> steer) {
  const P along = Turned ? u * P(steer.cosine) + v * P(steer.sine) : u, across = Turned ? v * P(steer.cosine) - u * P(steer.sine) : v;
  const P inverse = quotient(P(S(1)), regularised(along)), rim = omega * P(body.radius);
  // The floor is that of the scaled slips: one number a run, which the compiler takes out of the loop.
  const P s_x = (rim - along) * inverse, s_y = P(S(0)) - across * inverse, floor = quotient(P(S(least_slip)), stiffness);
  const P s = square_root(s_x * s_x + s_y * s_y + floor * floor), x = stiffness * s;
  const P force = friction * load * sine(P(body.shape) * arctan(x - P(body.curvature) * (x - arctan(x))));
  const P per_slip = quotient(force, s), F_x = per_slip * s_x, F_y = per_slip * s_y;
  const P slowing = P(body.rolling * body.radius) * load * opposing(rim);
  const P spin_rate = (P(torque) - slowing - P(body.radius) * F_x) * P(1 / body.wheel_inertia);
  if constexpr (Turned) return {F_x * P(steer.cosine) - F_y * P(steer.sine), F_x * P(steer.sine) + F_y * P(steer.cosine), spin_rate};
  else return {F_x, F_y, spin_rate};
}

template <class P, class S> INLINE void rates(const P *x, const Own<P> &own, const P &inverse_mass, const Body<S> &body, Steered<S> steer, P *dx) {
  const S base = body.front + body.rear, share = body.rear / base;
  const P u = x[v_x], v = x[v_y], r = x[turning];
  // Loads of a steady turn under these torques: a_x = T / (m R), a_y = v_x r; only m a_x is needed.
  const P weight = own.mass * P(S(gravity)), lever = own.mass * P(body.height) * (u * r);
  const S pull = 2 * (body.torque_front + body.torque_rear) / body.radius;
  const P axle = maximum(minimum(weight * P(body.rear / base) - P(pull * body.height / base), weight), P(S(0)));
  const Axle<P> front(axle, lever * P(share / body.track_front)), rear(weight - axle, lever * P((1 - share) / body.track_rear));
  const S left_front = body.track_front / 2, left_rear = body.track_rear / 2;
  const P v_front = v + r * P(body.front), v_rear = v - r * P(body.rear), df = r * P(left_front), dr = r * P(left_rear);
  const auto fl = wheel<true>(u - df, v_front, x[spin_fl], front.half - front.moved, own.stiffness_front, own.friction_front, body.torque_front, body, steer);
  const auto fr = wheel<true>(u + df, v_front, x[spin_fr], front.half + front.moved, own.stiffness_front, own.friction_front, body.torque_front, body, steer);
  const auto rl = wheel<false>(u - dr, v_rear, x[spin_rl], rear.half - rear.moved, own.stiffness_rear, own.friction_rear, body.torque_rear, body, steer);
  const auto rr = wheel<false>(u + dr, v_rear, x[spin_rr], rear.half + rear.moved, own.stiffness_rear, own.friction_rear, body.torque_rear, body, steer);
  const P Y_front = fl.F_y + fr.F_y, Y_rear = rl.F_y + rr.F_y;
  const P X = (fl.F_x + fr.F_x) + (rl.F_x + rr.F_x) - P(body.drag) * u * absolute(u);
  const P M = Y_front * P(body.front) - Y_rear * P(body.rear) + (fr.F_x - fl.F_x) * P(left_front) + (rr.F_x - rl.F_x) * P(left_rear);
  dx[v_x] = X * inverse_mass + v * r;
  dx[v_y] = (Y_front + Y_rear) * inverse_mass - u * r;
  dx[heading] = r;
  dx[turning] = M * P(1 / body.yaw_inertia);
  dx[spin_fl] = fl.spin_rate, dx[spin_fr] = fr.spin_rate, dx[spin_rl] = rl.spin_rate, dx[spin_rr] = rr.spin_rate;
}

// One Runge-Kutta step in place; `steer` is that at the step's start, middle and end.
template <class P, class S>
INLINE void runge_kutta(P *x, const Own<P> &own, const P &inverse_mass, const Body<S> &body, const Steered<S> *steer, S step) {
  const S weight[4] = {1, 2, 2, 1}, reach[4] = {step / 2, step / 2, step, 0};
  const int when[4] = {0, 1, 1, 2};
  P y[car_states], sum[car_states], dx[car_states];
  for (int i = 0; i < car_states; i++) y[i] = x[i], sum[i] = P(S(0));
  for (int stage = 0; stage < 4; stage++) {
    rates(y, own, inverse_mass, body, steer[when[stage]], dx);
    for (int i = 0; i < car_states; i++) sum[i] += P(weight[stage]) * dx[i], y[i] = x[i] + P(reach[stage]) * dx[i];
  }
  for (int i = 0; i < car_states; i++) x[i] += P(step / 6) * sum[i];
}
