// arctan, sin, cos, exp and log of a pack, to about one unit in the last place of the work they are used for:
// absolute 2e-7 in single and 1e-15 in double precision over the ranges of a vehicle (tested in tests/benchmarks/test_limit.py).
//
// The polynomials come from coefficients.py; `coefficients.hpp` is written next to the library when it is built.
#pragma once
#include "coefficients.hpp"
#include "vector.hpp"

// p[0] + p[1] x + ... by Horner's rule: the fewest operations, and two packs hide its latency.
template <class P, std::size_t N> INLINE P polynomial(P x, const double (&p)[N]) {
  P r = P(p[N - 1]);
#pragma GCC unroll 32
  for (int i = int(N) - 2; i >= 0; i--) r = r * x + P(p[i]);
  return r;
}

// Adding 1.5 * 2^(mantissa bits) rounds x to the nearest integer, which then sits in the low bits of the sum.
template <class P> INLINE P rounding_shift() { return P(is_single<P> ? 12582912.0 : 6755399441055744.0); }

template <class P> INLINE P arctan(P x) {
  P a = absolute(x), numerator, denominator, base, t, z;
  if constexpr (is_single<P>) {
    // |x| > 1 goes to pi/2 - arctan(1 / |x|); ten terms on [0, 1].
    auto beyond = a > P(1);
    numerator = select(beyond, P(-1), a);
    denominator = select(beyond, a, P(1));
    base = select(beyond, P(1.5707963267948966), P(0));
    t = quotient(numerator, denominator);
    z = t * t;
    return copy_sign(t * polynomial(z, coefficients::arctan_single) + base, x);
  } else {
    // Three ranges, so that |t| <= tan(pi/8) and half of the terms suffice; the middle one turns by pi/4.
    auto middle = a > P(0.41421356237309503), beyond = a > P(2.414213562373095);
    numerator = select(beyond, P(-1), select(middle, a - P(1), a));
    denominator = select(beyond, a, select(middle, a + P(1), P(1)));
    base = select(beyond, P(1.5707963267948966), select(middle, P(0.7853981633974483), P(0)));
    t = quotient(numerator, denominator);
    z = t * t;
    return copy_sign(t * polynomial(z, coefficients::arctan_double) + base, x);
  }
}

// sin(x), given about x / pi: x is brought to [-pi/2, pi/2] by whole multiples of pi, and odd multiples flip the sign.
template <class P> INLINE P sine_near(P x, P turns) {
  P shifted = turns + rounding_shift<P>(), k = shifted - rounding_shift<P>();
  // pi in two parts, the first with so few bits that k times it is exact.
  P r = x - k * P(is_single<P> ? 3.140625 : 3.141592653468251);
  r = r - k * P(is_single<P> ? 9.676535897932795e-04 : 1.2154201013012385e-10);
  P z = r * r, s;
  if constexpr (is_single<P>) s = r * polynomial(z, coefficients::sine_single);
  else s = r * polynomial(z, coefficients::sine_double);
  for (int i = 0; i < P::parts; i++) {
    auto odd = (unsigned_of<P>)shifted.v[i] << sign_shift<P>;
    s.v[i] = (typename P::Vector)((unsigned_of<P>)s.v[i] ^ odd);
  }
  return s;
}
template <class P> INLINE P sine(P x) { return sine_near(x, x * P(0.3183098861837907)); }
template <class P> INLINE P cosine(P x) { return sine(x + P(1.5707963267948966)); }

// sin of an angle within a quarter turn of 0, without range reduction.
template <class P> INLINE P half_turn_sine(P x) {
  if constexpr (is_single<P>) return x * polynomial(x * x, coefficients::sine_single);
  else return x * polynomial(x * x, coefficients::sine_double);
}

// sin and cos of a small angle, |x| <= pi/4, without range reduction.
template <class P> INLINE void small_sine_cosine(P x, P &s, P &c) {
  P z = x * x;
  if constexpr (is_single<P>) {
    s = x * polynomial(z, coefficients::small_sine_single);
    c = polynomial(z, coefficients::small_cosine_single);
  } else {
    s = x * polynomial(z, coefficients::small_sine_double);
    c = polynomial(z, coefficients::small_cosine_double);
  }
}

// sin and cos of any angle: a quarter turn is taken off k times, odd k swaps the two and the bits of k set the signs.
template <class P> INLINE void sine_cosine(P x, P &s, P &c) {
  P shifted = x * P(0.6366197723675814) + rounding_shift<P>(), k = shifted - rounding_shift<P>();
  P r = x - k * P(is_single<P> ? 1.5703125 : 1.5707963267341256);
  r = r - k * P(is_single<P> ? 4.838267948966396e-04 : 6.077100506506192e-11);
  P sine_r, cosine_r;
  small_sine_cosine(r, sine_r, cosine_r);
  for (int i = 0; i < P::parts; i++) {
    auto bits = (unsigned_of<P>)shifted.v[i];
    auto top = unsigned_of<P>{} + (typename Native<scalar_of<P>>::Unsigned(1) << sign_shift<P>);
    auto odd = (bits & 1) != 0;
    auto sine_bits = (unsigned_of<P>)(odd ? cosine_r.v[i] : sine_r.v[i]);
    auto cosine_bits = (unsigned_of<P>)(odd ? sine_r.v[i] : cosine_r.v[i]);
    s.v[i] = (typename P::Vector)(sine_bits ^ ((bits << (sign_shift<P> - 1)) & top));
    c.v[i] = (typename P::Vector)(cosine_bits ^ (((bits + 1) << (sign_shift<P> - 1)) & top));
  }
}

// tan of any angle: a quarter turn is taken off k times, and odd k gives -cot of the rest.
template <class P> INLINE P tangent(P x) {
  P shifted = x * P(0.6366197723675814) + rounding_shift<P>(), k = shifted - rounding_shift<P>();
  P r = x - k * P(is_single<P> ? 1.5703125 : 1.5707963267341256);
  r = r - k * P(is_single<P> ? 4.838267948966396e-04 : 6.077100506506192e-11);
  P s, c, top, bottom;
  small_sine_cosine(r, s, c);
  for (int i = 0; i < P::parts; i++) {
    auto odd = ((unsigned_of<P>)shifted.v[i] & 1) != 0;
    top.v[i] = odd ? -c.v[i] : s.v[i];
    bottom.v[i] = odd ? s.v[i] : c.v[i];
  }
  return quotient(top, bottom);
}

// exp(x) for x <= 0 or moderately positive; below about -80 (-700) it stays at the tiny value there.
template <class P> INLINE P exponential(P x) {
  x = maximum(x, P(is_single<P> ? -80.0 : -700.0));
  P shifted = x * P(1.4426950408889634) + rounding_shift<P>(), k = shifted - rounding_shift<P>();
  P r = x - k * P(is_single<P> ? 0.693359375 : 0.6931471803691238);
  r = r - k * P(is_single<P> ? -2.12194440054690583e-4 : 1.9082149292705877e-10);
  P e;
  if constexpr (is_single<P>) e = polynomial(r, coefficients::exponential_single);
  else e = polynomial(r, coefficients::exponential_double);
  for (int i = 0; i < P::parts; i++) {  // times 2^k: k is added to the exponent field
    auto scale = (unsigned_of<P>)shifted.v[i] << mantissa_bits<P>;
    e.v[i] = (typename P::Vector)((unsigned_of<P>)e.v[i] + scale);
  }
  return e;
}

// log(x) of a positive normal number: x = m 2^e with m in [sqrt(1/2), sqrt(2)], then an odd series in (m - 1) / (m + 1).
template <class P> INLINE P logarithm(P x) {
  using Word = typename Native<scalar_of<P>>::Word;
  constexpr Word half_root = is_single<P> ? Word(0x3f3504f3) : Word(0x3fe6a09e667f3bcd);
  P m, e;
  for (int i = 0; i < P::parts; i++) {
    auto bits = (words_of<P>)x.v[i];
    auto exponent = (bits - half_root) >> mantissa_bits<P>;
    m.v[i] = (typename P::Vector)(bits - (exponent << mantissa_bits<P>));
    e.v[i] = __builtin_convertvector(exponent, typename P::Vector);
  }
  P t = quotient(m - P(1), m + P(1)), z = t * t, p;
  if constexpr (is_single<P>) p = polynomial(z, coefficients::logarithm_single);
  else p = polynomial(z, coefficients::logarithm_double);
  return t * p + e * P(0.6931471805599453);
}
