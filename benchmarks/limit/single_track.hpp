// The vehicle of the particle filters: a single track with given speed and a Magic Formula a whole axle, eight of whose
// coefficients belong to the state.
#pragma once
#include "elementary.hpp"

enum State { lateral_velocity, yaw, yaw_rate, front_D, front_C, front_B, front_E, rear_D, rear_C, rear_B, rear_E, states };

template <class S> struct Car { S mass, inertia, front, rear, step; };
template <class S> struct Input { S steer, cos_steer, speed; };

// What the filter assumes about noise: standard deviations, and the normalising constant of the likelihood.
template <class S> struct Sensors { S yaw_rate_std, lateral_acceleration_std, log_constant; };

template <class P> INLINE P magic_formula(P slip, P D, P C, P B, P E) {
  P x = B * slip;
  return D * sine(C * arctan(x - E * (x - arctan(x))));
}

template <class P> struct Axles { P front, rear; };

template <class P> INLINE Axles<P> axle_forces(const P *x, P v_y, P r, const Car<scalar_of<P>> &car, const Input<scalar_of<P>> &u) {
  using S = scalar_of<P>;
  const S inverse_speed = S(1) / u.speed;
  P front_slip = P(u.steer) - arctan((v_y + r * P(car.front)) * P(inverse_speed));
  P rear_slip = -arctan((v_y - r * P(car.rear)) * P(inverse_speed));
  return {magic_formula(front_slip, x[front_D], x[front_C], x[front_B], x[front_E]) * P(u.cos_steer),
          magic_formula(rear_slip, x[rear_D], x[rear_C], x[rear_B], x[rear_E])};
}

// One Runge-Kutta step of (v_y, yaw, yaw rate) in place.
template <class P> INLINE void propagate(P *x, const Car<scalar_of<P>> &car, const Input<scalar_of<P>> &u) {
  using S = scalar_of<P>;
  const S inverse_mass = 1 / car.mass, inverse_inertia = 1 / car.inertia;
  const S weight[4] = {1, 2, 2, 1}, reach[4] = {car.step / 2, car.step / 2, car.step, 0};
  P v_y = x[lateral_velocity], r = x[yaw_rate], sum_v(0), sum_yaw(0), sum_r(0);
  for (int stage = 0; stage < 4; stage++) {
    auto force = axle_forces(x, v_y, r, car, u);
    P dv = (force.front + force.rear) * P(inverse_mass) - P(u.speed) * r;
    P dr = (force.front * P(car.front) - force.rear * P(car.rear)) * P(inverse_inertia);
    sum_v += P(weight[stage]) * dv;
    sum_yaw += P(weight[stage]) * r;
    sum_r += P(weight[stage]) * dr;
    v_y = x[lateral_velocity] + P(reach[stage]) * dv;
    r = x[yaw_rate] + P(reach[stage]) * dr;
  }
  const P sixth(car.step / 6);
  x[lateral_velocity] += sixth * sum_v;
  x[yaw] += sixth * sum_yaw;
  x[yaw_rate] += sixth * sum_r;
}

// log p(yaw rate, lateral acceleration | x).
template <class P>
INLINE P log_likelihood(const P *x, const Car<scalar_of<P>> &car, const Input<scalar_of<P>> &u, const Sensors<scalar_of<P>> &sensors,
                        scalar_of<P> measured_yaw_rate, scalar_of<P> measured_acceleration) {
  using S = scalar_of<P>;
  auto force = axle_forces(x, x[lateral_velocity], x[yaw_rate], car, u);
  P a = ((force.front + force.rear) * P(1 / car.mass) - P(measured_acceleration)) * P(1 / sensors.lateral_acceleration_std);
  P r = (x[yaw_rate] - P(measured_yaw_rate)) * P(1 / sensors.yaw_rate_std);
  return P(sensors.log_constant) - P(S(0.5)) * (a * a + r * r);
}
