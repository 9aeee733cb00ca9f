/// Elementary functions that give the same bits on every target.
///
/// Built from +, −, ×, ÷ and integer operations alone, without branches, so that a
/// compiler may vectorise them and no library's rounding comes in. Compile with
/// -ffp-contract=off: a fused multiply-add would change the last bit.
///
/// Errors, over the whole range: exp ≤ 1.5 ulp, expm1 ≤ 2.5 ulp, tanh ≤ 3 ulp (so it may step
/// back by that much between neighbours); log ≤ 1 ulp; atan ≤ 2.5 ulp; tan ≤ 3.5 ulp up to π/2,
/// beyond that ≤ 16 ulp up to 10 (float) or ≤ 4 ulp up to 1000 (double); sine and cosine,
/// absolute: 1.21e-7 (float), 2e-16 (double, fractions of 52 bits as every Angle has them),
/// 4.5e-16 (double, all 64 bits: only the upper 52 of the rest of a quarter turn are used). NaN
/// in gives NaN out.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace flexspline::math {

/// The unsigned integer as wide as S.
template <typename S>
using Bits = std::conditional_t<sizeof(S) == 4, std::uint32_t, std::uint64_t>;

template <typename S>
inline constexpr int mantissa_bits = std::numeric_limits<S>::digits - 1;

template <typename S>
inline constexpr S pi = S(3.141592653589793238462643383279502884L);

/// c0 + c1 x + c2 x² + … by Horner's rule, always in this order.
template <typename S>
constexpr S polynomial(S /*x*/, S c0) noexcept {
  return c0;
}
template <typename S, typename... Rest>
constexpr S polynomial(S x, S c0, Rest... rest) noexcept {
  return c0 + x * polynomial(x, S(rest)...);
}

/// One instruction wherever there is one, which no compiler makes of a comparison: −0 has a sign.
template <typename S>
constexpr S absolute(S x) noexcept {
  if (!std::is_constant_evaluated()) return std::abs(x);
  constexpr Bits<S> sign = Bits<S>(1) << (8 * sizeof(S) - 1);
  return std::bit_cast<S>(std::bit_cast<Bits<S>>(x) & ~sign);
}

/// x held within [low, high]; NaN stays NaN.
template <typename S>
constexpr S clamp(S x, S low, S high) noexcept {
  const S raised = x < low ? low : x;
  return raised > high ? high : raised;
}

/// x held within [−limit, limit]; NaN stays NaN.
template <typename S>
constexpr S clamp(S x, S limit) noexcept {
  const S edge = x < S(0) ? -limit : limit;
  return absolute(x) > limit ? edge : x;
}

/// True for everything but NaN and the infinities, whatever the compiler's options.
template <typename S>
constexpr bool is_finite(S x) noexcept {
  constexpr Bits<S> exponent = std::bit_cast<Bits<S>>(std::numeric_limits<S>::infinity());
  return (std::bit_cast<Bits<S>>(x) & exponent) != exponent;
}

/// True for what a period may be: above zero and neither NaN nor infinite.
template <typename S>
constexpr bool is_positive(S x) noexcept {
  constexpr Bits<S> infinity = std::bit_cast<Bits<S>>(std::numeric_limits<S>::infinity());
  return std::bit_cast<Bits<S>>(x) - 1 < infinity - 1;
}

/// x, or NaN where x is infinite: what is computed from it then shows it.
template <typename S>
constexpr S finite_or_nan(S x) noexcept {
  return x - (x - x);
}

/// ln 2 in two parts: the first times a small whole number is exact.
template <typename S>
inline constexpr S ln2_high = sizeof(S) == 4 ? S(0.693359375L) : S(6.93147180369123816490e-01L);
template <typename S>
inline constexpr S ln2_low = sizeof(S) == 4 ? S(-2.12194440e-4L) : S(1.90821492927058770002e-10L);

/// e^x = scale · (1 + remainder), scale a power of two, |remainder| < 0.42.
template <typename S>
struct Exponential {
  S scale;
  S remainder;
};

/// Where exponentials are clamped: the exponent fits, and subnormal numbers, slow on PCs, are rare.
template <typename S>
inline constexpr S largest_exponent = sizeof(S) == 4 ? S(80) : S(700);

/// Splits x = k ln 2 + r and expands e^r − 1; |x| ≤ largest_exponent. In float the expansion is the
/// best in 1 + r/2 + r² (c_0 + … + c_3 r³), in double Taylor's.
template <typename S>
constexpr Exponential<S> exponential(S held) noexcept {
  constexpr bool narrow = sizeof(S) == 4;
  constexpr S shift = narrow ? S(12582912) : S(6755399441055744);  // 1.5 · 2^mantissa_bits

  const S shifted = held * S(1.44269504088896340736L) + shift;
  const S k = shifted - shift;
  const S r = (held - k * ln2_high<S>)-k * ln2_low<S>;
  constexpr Bits<S> bias = Bits<S>(std::numeric_limits<S>::max_exponent - 1);
  const Bits<S> exponent = (std::bit_cast<Bits<S>>(shifted) + bias) << mantissa_bits<S>;
  const S scale = std::bit_cast<S>(exponent);
  if constexpr (narrow) {
    return {scale, r * polynomial(r, S(1), S(0.5), S(1.6666548e-1L), S(4.166686e-2L),
                                  S(8.36621e-3L), S(1.38983e-3L))};
  } else {
    return {scale, r * polynomial(r, S(1), S(1.0L / 2), S(1.0L / 6), S(1.0L / 24), S(1.0L / 120),
                                  S(1.0L / 720), S(1.0L / 5040), S(1.0L / 40320), S(1.0L / 362880),
                                  S(1.0L / 3628800), S(1.0L / 39916800), S(1.0L / 479001600),
                                  S(1.0L / 6227020800))};
  }
}

/// e^x; x below −80 or −700 gives the smallest value, above +80 or +700 the largest.
template <typename S>
constexpr S exp(S x) noexcept {
  const Exponential<S> e = exponential(clamp(x, largest_exponent<S>));
  return e.scale + e.scale * e.remainder;
}

/// e^x − 1, accurate near zero.
template <typename S>
constexpr S expm1(S x) noexcept {
  const Exponential<S> e = exponential(clamp(x, largest_exponent<S>));
  return e.scale * e.remainder + (e.scale - S(1));
}

/// e^(−x) − 1 for x ≥ 0, accurate near zero: what is left of a decay, less the whole.
template <typename S>
constexpr S expm1_negative(S x) noexcept {
  const S held = x > largest_exponent<S> ? largest_exponent<S> : x;
  const Exponential<S> e = exponential(-held);
  return e.scale * e.remainder + (e.scale - S(1));
}

/// Hyperbolic tangent: odd, tanh(±∞) = ±1, accurate near zero.
template <typename S>
constexpr S tanh(S x) noexcept {
  const S e = expm1_negative(S(2) * absolute(x));
  const S positive = -e / (S(2) + e);
  return x < S(0) ? -positive : positive;
}

/// Cosine and sine of one angle.
template <typename S>
struct Phasor {
  S cosine;
  S sine;
};

/// The phasor of the sum of two angles.
template <typename S>
constexpr Phasor<S> rotate(const Phasor<S>& a, const Phasor<S>& b) noexcept {
  return {a.cosine * b.cosine - a.sine * b.sine, a.sine * b.cosine + a.cosine * b.sine};
}

/// Cosine and sine of x radians, |x| ≤ π/4, by polynomials (S. Moshier's cephes in float, Sun's
/// fdlibm in double).
template <typename S>
constexpr Phasor<S> phasor_near_axis(S x) noexcept {
  const S z = x * x;
  S beyond_x;       // (sin x − x) / (x z)
  S beyond_square;  // (cos x − 1 + z/2) / z²
  if constexpr (sizeof(S) == 4) {
    beyond_x = polynomial(z, S(-1.6666654611e-1L), S(8.3321608736e-3L), S(-1.9515295891e-4L));
    beyond_square = polynomial(z, S(4.166664568298827e-2L), S(-1.388731625493765e-3L),
                               S(2.443315711809948e-5L));
  } else {
    beyond_x = polynomial(z, S(-1.66666666666666324348e-01L), S(8.33333333332248946124e-03L),
                          S(-1.98412698298579493134e-04L), S(2.75573137070700676789e-06L),
                          S(-2.50507602534068634195e-08L), S(1.58969099521155010221e-10L));
    beyond_square = polynomial(z, S(4.16666666666666019037e-02L), S(-1.38888888888741095749e-03L),
                               S(2.48015872894767294178e-05L), S(-2.75573143513906633035e-07L),
                               S(2.08757232129817482790e-09L), S(-1.13596475577881948265e-11L));
  }
  return {(S(1) - S(0.5) * z) + z * z * beyond_square, x + x * z * beyond_x};
}

/// Cosine and sine of `fraction` · 2^−b turns, b = 32 (float) or 64 (double).
///
/// The nearest quarter turn is taken off in integers, without rounding; the rest, at most an
/// eighth of a turn, goes through polynomials.
template <typename S>
constexpr Phasor<S> phasor(Bits<S> fraction) noexcept {
  constexpr int width = 8 * int(sizeof(S));
  const Bits<S> shifted = fraction + (Bits<S>(1) << (width - 3));
  const Bits<S> quadrant = shifted >> (width - 2);
  const Bits<S> rest = shifted << 2;  // a quarter turn is 2^width; its middle is the quarter's axis

  S x;
  if constexpr (sizeof(S) == 4) {
    const auto signed_rest = static_cast<std::int32_t>(rest ^ 0x80000000U);
    x = static_cast<S>(signed_rest) * (pi<S> / S(8589934592));
  } else {
    const S unit = std::bit_cast<S>((rest >> 12) | std::bit_cast<Bits<S>>(S(1)));
    x = (unit - S(1.5)) * (pi<S> / S(2));
  }
  const auto [cosine, sine] = phasor_near_axis(x);

  const bool odd = (quadrant & 1) != 0;
  const S along = odd ? sine : cosine;
  const S across = odd ? cosine : sine;
  const bool cosine_negative = ((quadrant + 1) & 2) != 0;
  const bool sine_negative = (quadrant & 2) != 0;
  return {cosine_negative ? -along : along, sine_negative ? -across : across};
}

/// Natural logarithm; −∞ at 0, NaN below it, +∞ at +∞. By x = 2^k m, m in [√½, √2), as in Sun's
/// fdlibm; numbers below the smallest normal one too.
template <typename S>
constexpr S log(S x) noexcept {
  constexpr bool narrow = sizeof(S) == 4;
  constexpr S infinity = std::numeric_limits<S>::infinity();
  constexpr S raise = S(Bits<S>(1) << std::numeric_limits<S>::digits);
  const bool small = x < std::numeric_limits<S>::min();
  const Bits<S> bits = std::bit_cast<Bits<S>>(small ? x * raise : x);
  constexpr Bits<S> lowest = std::bit_cast<Bits<S>>(S(0.70710678118654752440L));
  const auto exponent = static_cast<std::make_signed_t<Bits<S>>>(bits - lowest) >> mantissa_bits<S>;
  const S m = std::bit_cast<S>(bits - (static_cast<Bits<S>>(exponent) << mantissa_bits<S>));
  const S k = static_cast<S>(exponent) - (small ? S(std::numeric_limits<S>::digits) : S(0));

  const S f = m - S(1);
  const S s = f / (S(2) + f);
  const S z = s * s;
  S series;
  if constexpr (narrow) {
    series = z * polynomial(z, S(0.66666662693L), S(0.40000972152L), S(0.28498786688L),
                            S(0.24279078841L));
  } else {
    series = z * polynomial(z, S(6.666666666666735130e-01L), S(3.999999999940941908e-01L),
                            S(2.857142874366239149e-01L), S(2.222219843214978396e-01L),
                            S(1.818357216161805012e-01L), S(1.531383769920937332e-01L),
                            S(1.479819860511658591e-01L));
  }
  const S half_square = S(0.5) * f * f;
  const S value =
      k * ln2_high<S> - ((half_square - (s * (half_square + series) + k * ln2_low<S>)) - f);
  const S finite = x > S(0) ? value : std::numeric_limits<S>::quiet_NaN();
  const S from_zero = x == S(0) ? -infinity : finite;
  return x == infinity ? infinity : from_zero;
}

/// Arctangent in (−π/2, π/2), odd; atan(±∞) = ±π/2. Folded at π/8 and 3π/8.
template <typename S>
constexpr S atan(S x) noexcept {
  const S a = absolute(x);
  const bool far = a > S(2.41421356237309504880L);
  const bool near = !(a > S(0.41421356237309504880L));
  const S above = far ? S(-1) : (near ? a : a - S(1));
  const S below = far ? a : (near ? S(1) : a + S(1));
  const S t = above / below;
  const S z = t * t;
  S series;
  if constexpr (sizeof(S) == 4) {
    series = polynomial(z, S(3.33329491539e-1L), S(-1.99777106478e-1L), S(1.38776856032e-1L),
                        S(-8.05374449538e-2L));
  } else {
    series = polynomial(z, S(3.33333333333329318027e-01L), S(-1.99999999998764832476e-01L),
                        S(1.42857142725034663711e-01L), S(-1.11111104054623557880e-01L),
                        S(9.09088713343650656196e-02L), S(-7.69187620504482999495e-02L),
                        S(6.66107313738753120669e-02L), S(-5.83357013379057348645e-02L),
                        S(4.97687799461593236017e-02L), S(-3.65315727442169155270e-02L),
                        S(1.62858201153657823623e-02L));
  }
  const S folded = far ? pi<S> / S(2) : (near ? S(0) : pi<S> / S(4));
  constexpr S lost = sizeof(S) == 4 ? S(-4.37113882867e-8L) : S(6.12323399573676603587e-17L);
  const S rounding = far ? lost : (near ? S(0) : lost / S(2));
  const S positive = folded + ((rounding - t * (z * series)) + t);
  return x < S(0) ? -positive : positive;
}

/// Tangent; the nearest multiple of π/2 is taken off in three parts. Finite at S(π/2), whose
/// rounding keeps it beside the pole. NaN at ±∞.
template <typename S>
constexpr S tan(S x) noexcept {
  constexpr bool narrow = sizeof(S) == 4;
  constexpr S shift = narrow ? S(12582912) : S(6755399441055744);  // 1.5 · 2^mantissa_bits
  constexpr S first = narrow ? S(1.5703125L) : S(1.57079632673412561417e+00L);
  constexpr S second = narrow ? S(4.837512969970703125e-4L) : S(6.07710050630396597660e-11L);
  constexpr S third = narrow ? S(7.54978995489188216e-8L) : S(2.02226624879595063154e-21L);
  const S shifted = x * (S(2) / pi<S>)+shift;
  const S k = shifted - shift;
  const auto [cosine, sine] = phasor_near_axis(((x - k * first) - k * second) - k * third);
  const bool odd = (std::bit_cast<Bits<S>>(shifted) & 1) != 0;
  return (odd ? -cosine : sine) / (odd ? sine : cosine);
}

}  // namespace flexspline::math
