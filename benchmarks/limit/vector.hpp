// Packs of lanes: the only file that knows the machine.
//
// A Pack<S, K> holds K native vectors (64 bytes each with AVX-512, 32 without) and behaves like one number. K = 2 keeps two
// independent chains of dependent operations in flight, which hides the four-cycle latency of a fused multiply-add, and
// loads each polynomial coefficient once for both.
//
// No -ffast-math is needed, and none is wanted: it would undo the rounding trick in elementary.hpp, and a shared library
// linked with it switches off denormal numbers for the whole Python process that loads it. `a * b + c` still becomes one
// fused instruction (-ffp-contract=fast).
#pragma once
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>
#if defined(__AVX2__)
#include <immintrin.h>
#endif

#if defined(__AVX512F__) && defined(__AVX512DQ__)
inline constexpr int native_bytes = 64;
#else
inline constexpr int native_bytes = 32;
#endif

#define INLINE __attribute__((always_inline)) inline

template <class S> struct Native {
  typedef S type __attribute__((vector_size(native_bytes)));
  using Word = std::conditional_t<sizeof(S) == 4, int32_t, int64_t>;
  using Unsigned = std::make_unsigned_t<Word>;
  typedef Word word_type __attribute__((vector_size(native_bytes)));
  typedef Unsigned unsigned_type __attribute__((vector_size(native_bytes)));
  static constexpr int lanes = native_bytes / sizeof(S);
};

template <class S, int K> struct Pack {
  using Scalar = S;
  using Vector = typename Native<S>::type;
  static constexpr int parts = K;
  static constexpr int lanes = K * Native<S>::lanes;
  Vector v[K];

  Pack() = default;
  INLINE Pack(S x) {
    for (int k = 0; k < K; k++) v[k] = Vector{} + x;
  }
  // A constant that names itself in double precision and takes the precision of the pack.
  template <class Other> requires(std::is_arithmetic_v<Other> && !std::is_same_v<Other, S>)
  INLINE Pack(Other x) : Pack(static_cast<S>(x)) {}

  static INLINE Pack load(const S *p) {
    Pack r;
    std::memcpy(r.v, p, sizeof r.v);
    return r;
  }
  INLINE void store(S *p) const { std::memcpy(p, v, sizeof v); }

#define JV_BINARY(op)                                        \
  friend INLINE Pack operator op(Pack a, Pack b) {           \
    for (int k = 0; k < K; k++) a.v[k] = a.v[k] op b.v[k];   \
    return a;                                                \
  }
  JV_BINARY(+) JV_BINARY(-) JV_BINARY(*) JV_BINARY(/)
#undef JV_BINARY
  friend INLINE Pack operator-(Pack a) {
    for (int k = 0; k < K; k++) a.v[k] = -a.v[k];
    return a;
  }
  INLINE Pack &operator+=(Pack b) { return *this = *this + b; }
  INLINE Pack &operator*=(Pack b) { return *this = *this * b; }

  struct Mask { typename Native<S>::word_type v[K]; };
  friend INLINE Mask operator>(Pack a, Pack b) {
    Mask m;
    for (int k = 0; k < K; k++) m.v[k] = a.v[k] > b.v[k];
    return m;
  }
  friend INLINE Pack select(Mask m, Pack a, Pack b) {
    for (int k = 0; k < K; k++) a.v[k] = m.v[k] ? a.v[k] : b.v[k];
    return a;
  }
};

template <class P> using scalar_of = typename P::Scalar;
template <class P> using words_of = typename Native<scalar_of<P>>::word_type;
template <class P> using unsigned_of = typename Native<scalar_of<P>>::unsigned_type;
template <class P> inline constexpr bool is_single = sizeof(scalar_of<P>) == 4;
template <class P> inline constexpr int sign_shift = is_single<P> ? 31 : 63;
template <class P> inline constexpr int mantissa_bits = is_single<P> ? 23 : 52;

template <class P> INLINE P maximum(P a, P b) { return select(a > b, a, b); }
template <class P> INLINE P minimum(P a, P b) { return select(a > b, b, a); }

// |x|, and x with its sign flipped where the bit of `signs` is set.
template <class P> INLINE P absolute(P x) {
  for (auto &v : x.v) v = (typename P::Vector)((unsigned_of<P>)v & ~(typename Native<scalar_of<P>>::Unsigned(1) << sign_shift<P>));
  return x;
}
template <class P> INLINE P copy_sign(P magnitude, P sign) {
  for (int k = 0; k < P::parts; k++) {
    auto bit = (unsigned_of<P>)sign.v[k] & (typename Native<scalar_of<P>>::Unsigned(1) << sign_shift<P>);
    magnitude.v[k] = (typename P::Vector)((unsigned_of<P>)magnitude.v[k] | bit);
  }
  return magnitude;
}

template <class P> INLINE P square_root(P x) {
  for (auto &v : x.v) {
#if defined(__AVX512F__) && defined(__AVX512DQ__)
    if constexpr (is_single<P>) v = (typename P::Vector)_mm512_sqrt_ps((__m512)v);
    else v = (typename P::Vector)_mm512_sqrt_pd((__m512d)v);
#elif defined(__AVX2__)
    if constexpr (is_single<P>) v = (typename P::Vector)_mm256_sqrt_ps((__m256)v);
    else v = (typename P::Vector)_mm256_sqrt_pd((__m256d)v);
#else
    for (int l = 0; l < Native<scalar_of<P>>::lanes; l++) v[l] = __builtin_sqrt(v[l]);
#endif
  }
  return x;
}

// a / b. In single precision a 14-bit reciprocal and one Newton step (relative error 1e-7) is twice as fast as the divider;
// in double precision it would need two steps and loses to it.
template <class P> INLINE P quotient(P a, P b) {
#if defined(__AVX512F__) && defined(__AVX512DQ__)
  if constexpr (is_single<P>) {
    P r;
    for (int k = 0; k < P::parts; k++) r.v[k] = (typename P::Vector)_mm512_rcp14_ps((__m512)b.v[k]);
    r = r * (P(2) - b * r);
    return a * r;
  }
#endif
  return a / b;
}

// 1 / sqrt(x) of normal numbers: a 14-bit guess and one or two Newton steps, a third of the time of root and divider.
template <class P> INLINE P inverse_root(P x) {
#if defined(__AVX512F__) && defined(__AVX512DQ__)
  P r, half = P(scalar_of<P>(0.5)) * x;
  for (int k = 0; k < P::parts; k++) {
    if constexpr (is_single<P>) r.v[k] = (typename P::Vector)_mm512_rsqrt14_ps((__m512)x.v[k]);
    else r.v[k] = (typename P::Vector)_mm512_rsqrt14_pd((__m512d)x.v[k]);
  }
  for (int step = 0; step < (is_single<P> ? 1 : 2); step++) r = r * (P(1.5) - half * r * r);
  return r;
#else
  return P(1) / square_root(x);
#endif
}

template <class P> INLINE double sum_of_lanes(P x) {
  double s = 0;
  for (auto &v : x.v) for (int l = 0; l < Native<scalar_of<P>>::lanes; l++) s += v[l];
  return s;
}
template <class P> INLINE scalar_of<P> max_of_lanes(P x) {
  scalar_of<P> m = std::numeric_limits<scalar_of<P>>::lowest();
  for (auto &v : x.v) for (int l = 0; l < Native<scalar_of<P>>::lanes; l++) m = v[l] > m ? v[l] : m;
  return m;
}
template <class P> INLINE bool any_above(P x, scalar_of<P> bound) {
  words_of<P> m = {};
  for (auto &v : x.v) m |= v > (typename P::Vector{} + bound);
#if defined(__AVX512F__) && defined(__AVX512DQ__)
  if constexpr (is_single<P>) return _mm512_movepi32_mask((__m512i)m) != 0;
  else return _mm512_movepi64_mask((__m512i)m) != 0;
#elif defined(__AVX2__)
  return !_mm256_testz_si256((__m256i)m, (__m256i)m);
#else
  bool any = false;
  for (int l = 0; l < Native<scalar_of<P>>::lanes; l++) any |= m[l] != 0;
  return any;
#endif
}
