// Systematic resampling and the gather that follows it.
#pragma once
#include <algorithm>
#include "vector.hpp"

// Running sums of the lanes of one native vector: log2(lanes) shifted additions.
template <class P> INLINE P running_sum(P x) {
  static_assert(P::parts == 1);
  constexpr int lanes = P::lanes;
  const typename P::Vector zero = {};
  auto shifted = [&](auto step) {
    words_of<P> from;
    for (int l = 0; l < lanes; l++) from[l] = l >= step() ? l - step() : lanes;
    return __builtin_shuffle(x.v[0], zero, from);
  };
  x.v[0] += shifted(std::integral_constant<int, 1>{});
  x.v[0] += shifted(std::integral_constant<int, 2>{});
  if constexpr (lanes > 4) x.v[0] += shifted(std::integral_constant<int, 4>{});
  if constexpr (lanes > 8) x.v[0] += shifted(std::integral_constant<int, 8>{});
  return x;
}

// The int32 vector with as many lanes as a native vector of S.
template <class S> struct Index {
  typedef int32_t type __attribute__((vector_size(4 * Native<S>::lanes)));
};

// How many of the points (i + offset) / n, i = 0, 1, ..., lie below each running sum: ceil(n sum / total - offset).
template <class S> INLINE void offspring_bounds(const S *sums, int count, S scale, S offset, int32_t *bounds) {
  using P = Pack<S, 1>;
  using I = typename Index<S>::type;
  for (int j = 0; j < count; j += P::lanes) {
    P x = P::load(sums + j) * P(scale) - P(offset);
    I whole = __builtin_convertvector(x.v[0], I);
    // Conversion truncates; add one where something was cut off. (Between -1 and 0 truncation is already upwards.)
    auto cut = __builtin_convertvector(x.v[0] > __builtin_convertvector(whole, typename P::Vector), I);
    whole -= cut;
    std::memcpy(bounds + j, &whole, sizeof whole);
  }
}

// ancestors[bounds[j - 1] .. bounds[j]) = j. Every run is written as whole vectors that spill over its end, and the next run
// overwrites the spill: with 16 or fewer offspring there is one store and no loop that could be mispredicted. `ancestors`
// needs 16 spare places.
INLINE void fill_ancestors(const int32_t *bounds, int n, int32_t *ancestors) {
  typedef int32_t Sixteen __attribute__((vector_size(64)));
  int position = 0;
  for (int j = 0; j < n; j++) {
    const int end = j == n - 1 ? n : std::min(bounds[j], n);
    const Sixteen value = Sixteen{} + j;
    int p = position;
    do {
      std::memcpy(ancestors + p, &value, sizeof value);
      p += 16;
    } while (p < end);
    position = std::max(position, end);
  }
}

// field[ancestors[l]] for the lanes of a pack. Ancestors ascend, and a run of 16 of them mostly comes from fewer than 32
// neighbours: two loads and one permutation then replace a gather instruction, which costs a cycle or more a lane.
template <class P> class Gather {
  using S = scalar_of<P>;
  static constexpr int lanes = Native<S>::lanes;
  const int32_t *ancestors;
  int base[P::parts];
  bool near[P::parts];
  words_of<P> offset[P::parts];

public:
  INLINE explicit Gather(const int32_t *at) : ancestors(at) {
    for (int k = 0; k < P::parts; k++) {
      const int32_t *part = at + k * lanes;
      typename Index<S>::type index;
      std::memcpy(&index, part, sizeof index);
      base[k] = part[0];
      near[k] = part[lanes - 1] - base[k] < 2 * lanes;
      offset[k] = __builtin_convertvector(index - base[k], words_of<P>);
    }
  }
  INLINE P operator()(const S *field) const {
    P r;
    for (int k = 0; k < P::parts; k++) {
      if (__builtin_expect(near[k], 1)) {
        typename P::Vector low, high;
        std::memcpy(&low, field + base[k], sizeof low);
        std::memcpy(&high, field + base[k] + lanes, sizeof high);
        r.v[k] = __builtin_shuffle(low, high, offset[k]);
      } else {
        for (int l = 0; l < lanes; l++) r.v[k][l] = field[ancestors[k * lanes + l]];
      }
    }
    return r;
  }
};
