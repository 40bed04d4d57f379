// MF-Tyre 6.1: forces and moments of combined slip, limits on, with tan(slip angle) and sin(camber) as in the book.
//
// Every contact takes the same path (no branch on slow or parked wheels), so that time does not depend on the contacts. What
// depends on coefficients alone is a scalar, computed once a batch; axes and signs inside are ISO-W's.
#pragma once
#include "elementary.hpp"

// The order in which coefficients arrive; jaxveh_mf_tyre_names() tells it to the caller.
#define JV_MF_COEFFICIENTS(X)                                                                                              \
  X(UNLOADED_RADIUS) X(FNOMIN) X(LONGVL) X(NOMPRES) X(KPUMIN) X(KPUMAX) X(ALPMIN) X(ALPMAX) X(CAMMIN) X(CAMMAX) X(FZMIN)   \
  X(FZMAX) X(PRESMIN) X(PRESMAX) X(VXLOW) X(PCX1) X(PDX1) X(PDX2) X(PDX3) X(PEX1) X(PEX2) X(PEX3) X(PEX4) X(PKX1) X(PKX2)  \
  X(PKX3) X(PHX1) X(PHX2) X(PVX1) X(PVX2) X(PPX1) X(PPX2) X(PPX3) X(PPX4) X(RBX1) X(RBX2) X(RBX3) X(RCX1) X(REX1) X(REX2)  \
  X(RHX1) X(PCY1) X(PDY1) X(PDY2) X(PDY3) X(PEY1) X(PEY2) X(PEY3) X(PEY4) X(PEY5) X(PKY1) X(PKY2) X(PKY3) X(PKY4) X(PKY5)  \
  X(PKY6) X(PKY7) X(PHY1) X(PHY2) X(PVY1) X(PVY2) X(PVY3) X(PVY4) X(PPY1) X(PPY2) X(PPY3) X(PPY4) X(PPY5) X(RBY1) X(RBY2)  \
  X(RBY3) X(RBY4) X(RCY1) X(REY1) X(REY2) X(RHY1) X(RHY2) X(RVY1) X(RVY2) X(RVY3) X(RVY4) X(RVY5) X(RVY6) X(QBZ1) X(QBZ2)  \
  X(QBZ3) X(QBZ4) X(QBZ5) X(QBZ9) X(QBZ10) X(QCZ1) X(QDZ1) X(QDZ2) X(QDZ3) X(QDZ4) X(QDZ6) X(QDZ7) X(QDZ8) X(QDZ9)         \
  X(QDZ10) X(QDZ11) X(QEZ1) X(QEZ2) X(QEZ3) X(QEZ4) X(QEZ5) X(QHZ1) X(QHZ2) X(QHZ3) X(QHZ4) X(PPZ1) X(PPZ2) X(SSZ1)        \
  X(SSZ2) X(SSZ3) X(SSZ4) X(QSX1) X(QSX2) X(QSX3) X(QSX4) X(QSX5) X(QSX6) X(QSX7) X(QSX8) X(QSX9) X(QSX10) X(QSX11)        \
  X(QSX12) X(QSX13) X(QSX14) X(PPMX1) X(QSY1) X(QSY2) X(QSY3) X(QSY4) X(QSY5) X(QSY6) X(QSY7) X(QSY8) X(LFZO) X(LCX)       \
  X(LMUX) X(LEX) X(LKX) X(LHX) X(LVX) X(LCY) X(LMUY) X(LEY) X(LKY) X(LHY) X(LVY) X(LKYC) X(LKZC) X(LTR) X(LRES) X(LXAL)    \
  X(LYKA) X(LVYKA) X(LS) X(LMX) X(LVMX) X(LMY)

template <class S> struct MFTyre {
#define JV_FIELD(name) S name;
  JV_MF_COEFFICIENTS(JV_FIELD)
#undef JV_FIELD
};

template <class P> struct Contact { P slip_angle, slip_ratio, load, camber, friction, speed, pressure; };
template <class P> struct Forces { P F_x, F_y, M_x, M_y, M_z; };

// The contact within the ranges: `increment` of load and `dp` of pressure, and what several equations need.
template <class P> struct Operating {
  P load, moment_load, slip_ratio, camber, speed, pressure, increment, dp, tangent, sine, mu_x, mu_y, smooth;
};

template <class P> INLINE P square(P x) { return x * x; }
template <class P> INLINE P clip(P x, scalar_of<P> low, scalar_of<P> high) { return minimum(maximum(x, P(low)), P(high)); }
template <class P> INLINE P sign(P x) { return select(P(0) > x, P(-1), P(1)); }
template <class P> INLINE P not_zero(P x) { return x + select(P(0) > x, P(-1e-6), P(1e-6)); }
template <class P> INLINE P bent(P x, P E) { return x - E * (x - arctan(x)); }
template <class P> INLINE P curve_angle(P x, P B, P C, P E) { return C * arctan(bent(B * x, E)); }
template <class P> INLINE P cosine_of_arctan(P x) { return inverse_root(P(1) + x * x); }
template <class P> INLINE P weight(P x, P shift, P B, P C, P E) {
  return quotient(cosine(curve_angle(x + shift, B, C, E)), cosine(curve_angle(shift, B, C, E)));
}

template <class P> INLINE Operating<P> operating(const MFTyre<scalar_of<P>> &c, const Contact<P> &contact) {
  using S = scalar_of<P>;
  const S per_low = 1 / c.VXLOW, nominal = c.LFZO * c.FNOMIN;
  Operating<P> at;
  at.speed = absolute(contact.speed);
  P slow = at.speed * per_low, share = minimum(slow, P(1));
  // (1 - cos(pi share)) / 2, with the angle from the quarter turn.
  at.smooth = P(S(0.5)) + P(S(0.5)) * half_turn_sine((share - P(0.5)) * P(3.141592653589793));
  P angle = -contact.slip_angle;
  angle = clip(angle * minimum(slow * (P(1) + absolute(tangent(angle))), P(1)), c.ALPMIN, c.ALPMAX);
  at.tangent = tangent(angle);
  at.slip_ratio = clip(contact.slip_ratio * share, c.KPUMIN, c.KPUMAX);
  at.camber = clip(contact.camber, c.CAMMIN, c.CAMMAX);
  at.sine = sine(at.camber);
  at.load = clip(contact.load, S(0), c.FZMAX);
  at.moment_load = select(at.load > P(0), maximum(at.load, P(c.FZMIN)), P(0));
  at.pressure = clip(contact.pressure, c.PRESMIN, c.PRESMAX);
  at.increment = at.load * P(1 / nominal) - P(1);
  at.dp = at.pressure * P(1 / c.NOMPRES) - P(1);
  at.mu_x = P(c.LMUX) * contact.friction;
  at.mu_y = P(c.LMUY) * contact.friction;
  return at;
}

template <class P> struct Longitudinal { P force, stiffness; };

template <class P> INLINE Longitudinal<P> longitudinal(const MFTyre<scalar_of<P>> &c, const Operating<P> &at) {
  const P df = at.increment, dp = at.dp;
  P C(c.PCX1 * c.LCX);
  P kappa = at.slip_ratio + (P(c.PHX1 * c.LHX) + P(c.PHX2 * c.LHX) * df) * at.smooth;
  P mu = (P(c.PDX1) + P(c.PDX2) * df) * (P(1) + dp * (P(c.PPX3) + P(c.PPX4) * dp)) * (P(1) - P(c.PDX3) * square(at.camber)) * at.mu_x;
  P D = mu * at.load;
  P E = (P(c.PEX1) + df * (P(c.PEX2) + P(c.PEX3) * df)) * (P(c.LEX) - P(c.PEX4 * c.LEX) * sign(kappa));
  P K = at.load * (P(c.PKX1 * c.LKX) + P(c.PKX2 * c.LKX) * df) * exponential(P(c.PKX3) * df) * (P(1) + dp * (P(c.PPX1) + P(c.PPX2) * dp));
  P force = D * sine(curve_angle(kappa, quotient(K, not_zero(C * D)), C, minimum(E, P(1))));
  force += at.load * (P(c.PVX1 * c.LVX) + P(c.PVX2 * c.LVX) * df) * at.mu_x * at.smooth;
  P B = (P(c.RBX1 * c.LXAL) + P(c.RBX3 * c.LXAL) * square(at.sine)) * cosine_of_arctan(P(c.RBX2) * at.slip_ratio);
  P kept = weight(at.tangent, P(c.RHX1), B, P(c.RCX1), minimum(P(c.REX1) + P(c.REX2) * df, P(1)));
  return {kept * force, K};
}

template <class P> struct Lateral { P force, stiffness, mu, B, S_H, S_V; };

// Pure slip at a camber of which `sine` is the sine.
template <class P> INLINE Lateral<P> pure_lateral(const MFTyre<scalar_of<P>> &c, const Operating<P> &at, P sine_of_camber) {
  using S = scalar_of<P>;
  const S nominal = c.LFZO * c.FNOMIN;
  const P df = at.increment, dp = at.dp, bend = square(sine_of_camber), C(c.PCY1 * c.LCY);
  P reach = (P(c.PKY2) + P(c.PKY5) * bend) * (P(1) + P(c.PPY2) * dp);
  P K = P(c.PKY1 * nominal * c.LKY) * (P(1) + P(c.PPY1) * dp) * (P(1) - P(c.PKY3) * absolute(sine_of_camber));
  K = K * sine(P(c.PKY4) * arctan(quotient(at.load * P(1 / nominal), reach)));
  P cambered = at.load * sine_of_camber;
  P S_Vg = cambered * (P(c.PVY3 * c.LKYC) + P(c.PVY4 * c.LKYC) * df) * at.mu_y;
  P of_camber = cambered * (P(c.PKY6 * c.LKYC) + P(c.PKY7 * c.LKYC) * df) * (P(1) + P(c.PPY5) * dp);
  P S_H = (P(c.PHY1 * c.LHY) + P(c.PHY2 * c.LHY) * df + quotient(of_camber - S_Vg, not_zero(K))) * at.smooth;
  P S_V = (at.load * (P(c.PVY1 * c.LVY) + P(c.PVY2 * c.LVY) * df) * at.mu_y + S_Vg) * at.smooth;
  P alpha = at.tangent + S_H;
  P mu = (P(c.PDY1) + P(c.PDY2) * df) * (P(1) + dp * (P(c.PPY3) + P(c.PPY4) * dp)) * (P(1) - P(c.PDY3) * bend) * at.mu_y;
  P D = mu * at.load, B = quotient(K, not_zero(C * D));
  P side = P(1) + P(c.PEY5) * bend - (P(c.PEY3) + P(c.PEY4) * sine_of_camber) * sign(alpha);
  P E = minimum((P(c.PEY1 * c.LEY) + P(c.PEY2 * c.LEY) * df) * side, P(1));
  return {D * sine(curve_angle(alpha, B, C, E)) + S_V, K, mu, B, S_H, S_V};
}

template <class P> INLINE P lateral_weight(const MFTyre<scalar_of<P>> &c, const Operating<P> &at) {
  P B = (P(c.RBY1 * c.LYKA) + P(c.RBY4 * c.LYKA) * square(at.sine)) * cosine_of_arctan(P(c.RBY2) * (at.tangent - P(c.RBY3)));
  P E = minimum(P(c.REY1) + P(c.REY2) * at.increment, P(1));
  return weight(at.slip_ratio, P(c.RHY1) + P(c.RHY2) * at.increment, B, P(c.RCY1), E);
}

// The lateral force that slip ratio adds.
template <class P> INLINE P added_lateral(const MFTyre<scalar_of<P>> &c, const Operating<P> &at, P mu) {
  P D = mu * at.load * (P(c.RVY1) + P(c.RVY2) * at.increment + P(c.RVY3) * at.sine) * cosine_of_arctan(P(c.RVY4) * at.tangent);
  return D * sine(P(c.RVY5) * arctan(P(c.RVY6) * at.slip_ratio)) * P(c.LVYKA) * at.smooth;
}

// The slip angle that counts in combined slip; `slip` is the square of the slip ratio's part.
template <class P> INLINE P equivalent(P alpha, P slip) { return arctan(square_root(square(tangent(alpha)) + slip)) * sign(alpha); }

template <class P>
INLINE P aligning_moment(const MFTyre<scalar_of<P>> &c, const Operating<P> &at, const Longitudinal<P> &along, const Lateral<P> &pure,
                         P F_y, P on_trail) {
  using S = scalar_of<P>;
  const S R = c.UNLOADED_RADIUS;
  const P df = at.increment, dp = at.dp, camber = at.camber, per_stiffness = quotient(P(1), not_zero(pure.stiffness));
  P slip = square(along.stiffness * per_stiffness * at.slip_ratio), per_mu = quotient(P(1), at.mu_y);
  // Trail.
  P alpha = at.tangent + P(c.QHZ1) + P(c.QHZ2) * df + (P(c.QHZ3) + P(c.QHZ4) * df) * at.sine;
  P B = (P(c.QBZ1) + df * (P(c.QBZ2) + P(c.QBZ3) * df)) * (P(1) + P(c.QBZ4) * camber + P(c.QBZ5) * absolute(camber));
  B = B * P(c.LKY) * per_mu;
  P D = (P(c.QDZ1) + P(c.QDZ2) * df) * (P(1) - P(c.PPZ1) * dp) * (P(1) + camber * (P(c.QDZ3) + P(c.QDZ4) * camber));
  D = D * at.moment_load * P(R / c.FNOMIN * c.LTR);  // LFZO cancels
  P side = P(1) + (P(c.QEZ4) + P(c.QEZ5) * at.sine) * P(0.6366197723675814) * arctan(B * P(c.QCZ1) * alpha);
  P E = minimum((P(c.QEZ1) + df * (P(c.QEZ2) + P(c.QEZ3) * df)) * side, P(1));
  P course = quotient(at.speed, at.speed * square_root(P(1) + square(at.tangent)) + P(1e-6));
  P trail = D * cosine(curve_angle(equivalent(alpha, slip), B, P(c.QCZ1), E)) * course * at.smooth;
  // Residual torque.
  P turned = at.tangent + pure.S_H + pure.S_V * per_stiffness;
  P B_r = P(c.QBZ9 * c.LKY) * per_mu + P(c.QBZ10 * c.PCY1 * c.LCY) * pure.B;
  P of_camber = (P(c.QDZ8) + P(c.QDZ9) * df) * (P(1) + P(c.PPZ2) * dp) + (P(c.QDZ10) + P(c.QDZ11) * df) * absolute(at.sine);
  P peak = P(c.QDZ6 * c.LRES) + P(c.QDZ7 * c.LRES) * df + of_camber * at.sine * P(c.LKZC);
  P residual = at.moment_load * P(R) * peak * at.mu_y * cosine(at.tangent) * cosine_of_arctan(B_r * equivalent(turned, slip)) * at.smooth;
  P arm = P(c.SSZ1) + P(c.SSZ2 / c.FNOMIN) * F_y + (P(c.SSZ3) + P(c.SSZ4) * df) * camber;
  return residual - trail * on_trail + P(R * c.LS) * arm * along.force;
}

template <class P> INLINE P overturning_moment(const MFTyre<scalar_of<P>> &c, const Operating<P> &at, P F_y) {
  using S = scalar_of<P>;
  const S per_nominal = 1 / c.FNOMIN, per_least = c.FZMIN > 0 ? 1 / c.FZMIN : S(1);
  const P camber = at.camber;
  P load = select(P(c.FZMIN) > at.load, at.load * square(at.load * P(per_least)), at.load);
  P share = load * P(per_nominal), side = F_y * P(per_nominal);
  P mixed = cosine(P(c.QSX5) * arctan(square(P(c.QSX6) * share))) * sine(P(c.QSX7) * camber + P(c.QSX8) * arctan(P(c.QSX9) * side));
  P with_load = P(c.QSX1 * c.LVMX) - P(c.QSX2) * camber * (P(1) + P(c.PPMX1) * at.dp) + P(c.QSX3) * side + P(c.QSX4) * mixed;
  with_load += P(c.QSX10) * arctan(P(c.QSX11) * share) * camber;
  P rest = F_y * (P(c.QSX13) + P(c.QSX14) * absolute(camber)) - load * P(c.QSX12) * camber * absolute(camber);
  return P(c.UNLOADED_RADIUS * c.LMX) * (load * with_load + rest);
}

template <class P> INLINE P rolling_moment(const MFTyre<scalar_of<P>> &c, const Operating<P> &at, P F_x, P given, P slip_ratio) {
  using S = scalar_of<P>;
  const S least = c.FZMIN > 0 ? c.FZMIN : S(1);
  // The load as it is given, beyond FZMAX too.
  given = maximum(given, P(0));
  P load = select(P(c.FZMIN) > given, square(given) * P(1 / least), given);
  P share = load * P(1 / c.FNOMIN), speed = at.speed * P(1 / c.LONGVL);
  P sum = P(c.QSY1) + P(c.QSY2 / c.FNOMIN) * F_x + P(c.QSY3) * speed + P(c.QSY4) * square(square(speed));
  sum += (P(c.QSY5) + P(c.QSY6) * share) * square(at.camber);
  auto carries = share > P(0);
  P powers = exponential(P(c.QSY7) * logarithm(select(carries, share, P(1))) + P(c.QSY8) * logarithm(at.pressure * P(1 / c.NOMPRES)));
  // 1 for a wheel that rolls forward, -1 backward, a sine between; `rolls` is the wheel's own speed over VXLOW.
  auto moves = at.speed > P(0);
  P high = quotient(P(c.VXLOW), select(moves, at.speed, P(1))) - P(1), low = P(-1 - c.VXLOW) - high;
  P rolls = (slip_ratio + P(1)) * at.speed * P(1 / c.VXLOW);
  P turns = select(slip_ratio > high, P(1), select(low > slip_ratio, P(-1), sine(P(1.5707963267948966) * rolls)));
  P moment = P(-c.UNLOADED_RADIUS * c.FNOMIN * c.LMY) * sum * powers * turns;
  return select(moves, select(carries, moment, P(0)), P(0));
}

template <class P> INLINE Forces<P> forces(const MFTyre<scalar_of<P>> &c, const Contact<P> &contact) {
  const Operating<P> at = operating(c, contact);
  const Longitudinal<P> along = longitudinal(c, at);
  const Lateral<P> across = pure_lateral(c, at, at.sine);
  const P kept = lateral_weight(c, at);
  Forces<P> f;
  f.F_x = along.force;
  f.F_y = kept * across.force + added_lateral(c, at, across.mu);
  f.M_x = overturning_moment(c, at, f.F_y);
  f.M_y = rolling_moment(c, at, f.F_x, contact.load, contact.slip_ratio);
  f.M_z = aligning_moment(c, at, along, across, f.F_y, kept * pure_lateral(c, at, P(0)).force);
  return f;
}
