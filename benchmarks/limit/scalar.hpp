// A single number behaves like a pack of one lane, so that a model written once serves a batch and one run.
#pragma once
#include <cmath>
#include "elementary.hpp"

template <class S> concept Real = std::is_floating_point_v<S>;

template <class P> struct ScalarOf { using type = typename P::Scalar; };
template <Real S> struct ScalarOf<S> { using type = S; };
// The type of one lane: `double` of a pack of doubles, and of a double.
template <class P> using lane_of = typename ScalarOf<P>::type;

template <Real S> INLINE S select(bool yes, S a, S b) { return yes ? a : b; }
template <Real S> INLINE S maximum(S a, S b) { return a > b ? a : b; }
template <Real S> INLINE S minimum(S a, S b) { return a > b ? b : a; }
template <Real S> INLINE S absolute(S x) { return std::abs(x); }
template <Real S> INLINE S square_root(S x) { return std::sqrt(x); }
template <Real S> INLINE S quotient(S a, S b) { return a / b; }
template <Real S> INLINE S inverse_root(S x) { return S(1) / std::sqrt(x); }

// Terms of double precision whatever S is: one run is measured in double precision.
// Even and odd terms side by side: a single number waits for each step of Horner's rule.
template <Real S, std::size_t N> INLINE S two_chains(S x, const double (&p)[N]) {
  const S square = x * x;
  constexpr int top = int(N) - 1;
  S high = S(p[top]), low = S(p[top - 1]);
#pragma GCC unroll 32
  for (int i = top - 2; i >= 0; i -= 2) high = high * square + S(p[i]);
#pragma GCC unroll 32
  for (int i = top - 3; i >= 0; i -= 2) low = low * square + S(p[i]);
  return top % 2 ? high * x + low : low * x + high;
}

template <Real S> INLINE S arctan(S x) {
  const S a = absolute(x);
  const bool middle = a > S(0.41421356237309503), beyond = a > S(2.414213562373095);
  const S numerator = beyond ? S(-1) : middle ? a - S(1) : a, denominator = beyond ? a : middle ? a + S(1) : S(1);
  const S base = beyond ? S(1.5707963267948966) : middle ? S(0.7853981633974483) : S(0), t = numerator / denominator;
  return std::copysign(t * two_chains(t * t, coefficients::arctan_double) + base, x);
}

template <Real S> INLINE S sine(S x) {
  const S shift = sizeof(S) == 4 ? S(12582912.0) : S(6755399441055744.0), k = (x * S(0.3183098861837907) + shift) - shift;
  S r = x - k * S(3.140625);
  r = r - k * S(9.676535897932385e-04);
  const S half = k * S(0.5), sign = S(1) - S(4) * (half - std::floor(half));
  return sign * (r * two_chains(r * r, coefficients::sine_double));
}
