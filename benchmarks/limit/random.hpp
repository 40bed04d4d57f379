// Normal random numbers: one small counter-based chaotic generator ("SFC", C. Doty-Humphrey, as in NumPy's SFC64) a lane,
// then Box and Muller's transform.
#pragma once
#include "elementary.hpp"

template <class S> class Normals {
  using Word = typename Native<S>::Unsigned;
  using Words = typename Native<S>::unsigned_type;
  using One = Pack<S, 1>;
  static constexpr int bits = 8 * sizeof(S), mantissa = mantissa_bits<One>;
  Words a, b, c, counter;

  INLINE Words next() {
    constexpr int right = sizeof(S) == 4 ? 9 : 11, turn = sizeof(S) == 4 ? 21 : 24;
    Words result = a + b + counter;
    counter += 1;
    a = b ^ (b >> right);
    b = c + (c << 3);
    c = ((c << turn) | (c >> (bits - turn))) + result;
    return result;
  }
  // The top bits of a word as the mantissa of a number in [1, 2).
  static INLINE One one_to_two(Words word) {
    constexpr Word one = sizeof(S) == 4 ? Word(0x3f800000u) : Word(0x3ff0000000000000ull);
    One r;
    r.v[0] = (typename One::Vector)((word >> (bits - mantissa)) | one);
    return r;
  }

public:
  explicit Normals(uint64_t seed) {
    auto scramble = [&seed] {  // SplitMix64
      uint64_t z = (seed += 0x9e3779b97f4a7c15ull);
      z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
      z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
      return z ^ (z >> 31);
    };
    for (int l = 0; l < Native<S>::lanes; l++) a[l] = Word(scramble()), b[l] = Word(scramble()), c[l] = Word(scramble());
    counter = Words{} + Word(1);
    for (int i = 0; i < 16; i++) next();
  }

  // One number in [0, 1).
  INLINE S uniform() { return one_to_two(next()).v[0][0] - S(1); }

  // Two independent standard normals a lane. The angle is drawn in a quarter turn, where short polynomials do, and two
  // spare bits of its word choose the quadrant by flipping signs.
  INLINE Pack<S, 2> pair() {
    One u = zero_excluded(next());
    Words word = next();
    One angle = (one_to_two(word) - One(1.5)) * One(1.5707963267948966);
    One s, c;
    small_sine_cosine(angle, s, c);
    // sqrt(-2 log u) times the sqrt(1/2) that turns (c - s, c + s) back by an eighth.
    One radius = square_root(-logarithm(u));
    One x = radius * (c - s), y = radius * (c + s);
    Words top = Words{} + (Word(1) << (bits - 1));
    Pack<S, 2> r;
    r.v[0] = (typename One::Vector)((Words)x.v[0] ^ ((word << (bits - 1)) & top));
    r.v[1] = (typename One::Vector)((Words)y.v[0] ^ ((word << (bits - 2)) & top));
    return r;
  }

private:
  // In (0, 1], so that its logarithm is finite.
  static INLINE One zero_excluded(Words word) { return One(2) - one_to_two(word); }
};
