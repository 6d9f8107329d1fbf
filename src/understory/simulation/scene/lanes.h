#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#ifdef __AVX2__
#include <immintrin.h>
#endif

// Eight floats that are worked on together: one register where the program is compiled for AVX2
// (cmake/Gtsam.cmake, the default). Elsewhere they are plain loops, which the compiler cuts in
// pieces. Comparisons give masks, one bit a lane; what is not a number compares false.
namespace understory {

constexpr std::size_t kLanes = 8;

#ifdef __AVX2__
using LaneRegister = __m256;
using MaskRegister = __m256;
#else
using LaneRegister = std::array<float, kLanes>;
using MaskRegister = unsigned;
#endif

// A truth value for each of eight lanes.
struct LaneMask {
  [[nodiscard]] unsigned bits() const;
  MaskRegister v;
};

// Eight floats, one a lane; all operations act lane by lane.
struct Lanes {
  Lanes() = default;
  Lanes(float all);
  explicit Lanes(const LaneRegister& value) : v(value) {}
  static Lanes load(const float* values);  // eight
  void store(float* to) const;             // eight
  LaneRegister v;
};

#ifdef __AVX2__

inline unsigned LaneMask::bits() const {
  return static_cast<unsigned>(_mm256_movemask_ps(v));
}
inline Lanes::Lanes(float all) : v(_mm256_set1_ps(all)) {}
inline Lanes Lanes::load(const float* values) {
  return Lanes(_mm256_loadu_ps(values));
}
inline void Lanes::store(float* to) const {
  _mm256_storeu_ps(to, v);
}
inline LaneMask operator&(LaneMask a, LaneMask b) {
  return {_mm256_and_ps(a.v, b.v)};
}
inline LaneMask operator|(LaneMask a, LaneMask b) {
  return {_mm256_or_ps(a.v, b.v)};
}

inline Lanes operator+(Lanes a, Lanes b) {
  return Lanes(_mm256_add_ps(a.v, b.v));
}
inline Lanes operator-(Lanes a, Lanes b) {
  return Lanes(_mm256_sub_ps(a.v, b.v));
}
inline Lanes operator*(Lanes a, Lanes b) {
  return Lanes(_mm256_mul_ps(a.v, b.v));
}
inline Lanes operator/(Lanes a, Lanes b) {
  return Lanes(_mm256_div_ps(a.v, b.v));
}
inline LaneMask operator<(Lanes a, Lanes b) {
  return {_mm256_cmp_ps(a.v, b.v, _CMP_LT_OQ)};
}
inline LaneMask operator<=(Lanes a, Lanes b) {
  return {_mm256_cmp_ps(a.v, b.v, _CMP_LE_OQ)};
}
// The smaller value, lane by lane.
inline Lanes min(Lanes a, Lanes b) {
  return Lanes(_mm256_min_ps(a.v, b.v));
}
// The larger value, lane by lane.
inline Lanes max(Lanes a, Lanes b) {
  return Lanes(_mm256_max_ps(a.v, b.v));
}
// The root, lane by lane.
inline Lanes sqrt(Lanes a) {
  return Lanes(_mm256_sqrt_ps(a.v));
}
// a where the mask is true, b elsewhere.
inline Lanes select(LaneMask where, Lanes a, Lanes b) {
  return Lanes(_mm256_blendv_ps(b.v, a.v, where.v));
}
// The largest of the eight values.
inline float largest(Lanes a) {
  const __m128 four = _mm_max_ps(_mm256_castps256_ps128(a.v), _mm256_extractf128_ps(a.v, 1));
  const __m128 two = _mm_max_ps(four, _mm_movehl_ps(four, four));
  return _mm_cvtss_f32(_mm_max_ss(two, _mm_movehdup_ps(two)));
}
// The most of x, y and z over the lanes of a mask, any number, their least, any number.
inline Lanes extremes(Lanes x, Lanes y, Lanes z, LaneMask where) {
  // Halves of each, then quarters of x and y beside each other, then all.
  const auto join = [](__m128 xs, __m128 ys, __m128 zs, const auto& pick) {
    const __m128 xy = pick(_mm_unpacklo_ps(xs, ys), _mm_unpackhi_ps(xs, ys));
    const __m128 zz = pick(zs, _mm_movehl_ps(zs, zs));
    return pick(_mm_movelh_ps(xy, zz), _mm_shuffle_ps(xy, zz, _MM_SHUFFLE(1, 1, 3, 2)));
  };
  const auto more = [](__m128 a, __m128 b) { return _mm_max_ps(a, b); };
  const auto less = [](__m128 a, __m128 b) { return _mm_min_ps(a, b); };
  const auto fold = [&](Lanes a, float others, const auto& pick) {
    const __m256 counted = select(where, a, Lanes(others)).v;
    return pick(_mm256_castps256_ps128(counted), _mm256_extractf128_ps(counted, 1));
  };
  constexpr float kFar = std::numeric_limits<float>::infinity();
  const __m128 most = join(fold(x, -kFar, more), fold(y, -kFar, more), fold(z, -kFar, more), more);
  const __m128 least = join(fold(x, kFar, less), fold(y, kFar, less), fold(z, kFar, less), less);
  return Lanes(_mm256_set_m128(least, most));
}
// The first lanes of x, y and z, any number, the same again.
inline Lanes first_lanes(Lanes x, Lanes y, Lanes z) {
  const __m128 xy = _mm_unpacklo_ps(_mm256_castps256_ps128(x.v), _mm256_castps256_ps128(y.v));
  const __m128 xyz = _mm_movelh_ps(xy, _mm256_castps256_ps128(z.v));
  return Lanes(_mm256_set_m128(xyz, xyz));
}
// Of eight whole numbers, at a multiple of 16 bytes.
inline Lanes lanes_of(const std::uint16_t* numbers) {
  const __m128i narrow = _mm_load_si128(reinterpret_cast<const __m128i*>(numbers));
  return Lanes(_mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(narrow)));
}
inline Lanes lanes_of(const float* numbers) {
  return Lanes(_mm256_loadu_ps(numbers));
}
// Which of eight numbers have their highest bit set, and which are not all ones; at a multiple of
// 32 bytes.
inline unsigned marked(const std::uint32_t* numbers) {
  return static_cast<unsigned>(
      _mm256_movemask_ps(_mm256_load_ps(reinterpret_cast<const float*>(numbers))));
}
inline unsigned taken(const std::uint32_t* numbers) {
  const __m256i all = _mm256_load_si256(reinterpret_cast<const __m256i*>(numbers));
  const __m256i free = _mm256_cmpeq_epi32(all, _mm256_set1_epi32(-1));
  return 0xffU ^ static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(free)));
}

#else

inline unsigned LaneMask::bits() const {
  return v;
}
inline Lanes::Lanes(float all) {
  v.fill(all);
}
inline Lanes Lanes::load(const float* values) {
  Lanes result;
  for (std::size_t i = 0; i < kLanes; ++i)
    result.v[i] = values[i];
  return result;
}
inline void Lanes::store(float* to) const {
  for (std::size_t i = 0; i < kLanes; ++i)
    to[i] = v[i];
}
inline LaneMask operator&(LaneMask a, LaneMask b) {
  return {a.v & b.v};
}
inline LaneMask operator|(LaneMask a, LaneMask b) {
  return {a.v | b.v};
}

// From here to the end of the branch: the same operations one lane after another, for machines
// without AVX.
template <class Function>
Lanes lane_by_lane(const Lanes& a, const Lanes& b, Function function) {
  Lanes result;
  for (std::size_t i = 0; i < kLanes; ++i)
    result.v[i] = function(a.v[i], b.v[i]);
  return result;
}
template <class Function>
LaneMask compare(const Lanes& a, const Lanes& b, Function function) {
  LaneMask mask{0};
  for (std::size_t i = 0; i < kLanes; ++i)
    mask.v |= function(a.v[i], b.v[i]) ? 1U << i : 0U;
  return mask;
}
inline Lanes operator+(const Lanes& a, const Lanes& b) {
  return lane_by_lane(a, b, [](float x, float y) { return x + y; });
}
inline Lanes operator-(const Lanes& a, const Lanes& b) {
  return lane_by_lane(a, b, [](float x, float y) { return x - y; });
}
inline Lanes operator*(const Lanes& a, const Lanes& b) {
  return lane_by_lane(a, b, [](float x, float y) { return x * y; });
}
inline Lanes operator/(const Lanes& a, const Lanes& b) {
  return lane_by_lane(a, b, [](float x, float y) { return x / y; });
}
inline LaneMask operator<(const Lanes& a, const Lanes& b) {
  return compare(a, b, [](float x, float y) { return x < y; });
}
inline LaneMask operator<=(const Lanes& a, const Lanes& b) {
  return compare(a, b, [](float x, float y) { return x <= y; });
}
inline Lanes min(const Lanes& a, const Lanes& b) {
  return lane_by_lane(a, b, [](float x, float y) { return x < y ? x : y; });
}
inline Lanes max(const Lanes& a, const Lanes& b) {
  return lane_by_lane(a, b, [](float x, float y) { return x > y ? x : y; });
}
inline Lanes sqrt(const Lanes& a) {
  return lane_by_lane(a, a, [](float x, float) { return std::sqrt(x); });
}
inline Lanes select(LaneMask where, const Lanes& a, const Lanes& b) {
  Lanes result;
  for (std::size_t i = 0; i < kLanes; ++i)
    result.v[i] = (where.v >> i & 1U) != 0 ? a.v[i] : b.v[i];
  return result;
}
inline float largest(const Lanes& a) {
  float most = a.v[0];
  for (const float value : a.v)
    most = value > most ? value : most;
  return most;
}
inline Lanes extremes(const Lanes& x, const Lanes& y, const Lanes& z, LaneMask where) {
  constexpr float kFar = std::numeric_limits<float>::infinity();
  const Lanes none(0.0F);
  Lanes result(0.0F);
  const Lanes* all[] = {&x, &y, &z};
  for (std::size_t k = 0; k < 3; ++k) {
    result.v[k] = largest(select(where, *all[k], Lanes(-kFar)));
    result.v[k + 4] = -largest(select(where, none - *all[k], Lanes(-kFar)));
  }
  return result;
}
inline Lanes first_lanes(const Lanes& x, const Lanes& y, const Lanes& z) {
  return Lanes({x.v[0], y.v[0], z.v[0], 0.0F, x.v[0], y.v[0], z.v[0], 0.0F});
}
inline Lanes lanes_of(const std::uint16_t* numbers) {
  Lanes result;
  for (std::size_t i = 0; i < kLanes; ++i)
    result.v[i] = static_cast<float>(numbers[i]);
  return result;
}
inline Lanes lanes_of(const float* numbers) {
  return Lanes::load(numbers);
}
inline unsigned marked(const std::uint32_t* numbers) {
  unsigned bits = 0;
  for (std::size_t i = 0; i < kLanes; ++i)
    bits |= numbers[i] >> 31U << i;
  return bits;
}
inline unsigned taken(const std::uint32_t* numbers) {
  unsigned bits = 0;
  for (std::size_t i = 0; i < kLanes; ++i)
    bits |= numbers[i] != ~0U ? 1U << i : 0U;
  return bits;
}

#endif

// Eight vectors.
struct Lanes3 {
  Lanes x, y, z;
};
// The inner products of eight pairs of vectors.
inline Lanes dot(const Lanes3& a, const Lanes3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

}  // namespace understory
