/// cos and sin of many angles.
///
///   x = k π/2 + r,  |r| <= π/4;   polynomials of degree 13 and 14 in r;   k mod 4 turns them
///
/// π/2 is subtracted in three parts of 33 bits, the first of them exactly for |x| <= 1e6; beyond
/// it, for infinities and for NaN the answer is NaN. Absolute error < 2e-16. Source: fdlibm
/// (k_sin.c, k_cos.c, e_rem_pio2.c), [Sun1993].
#pragma once

#include <math.h>

#include "host/lanes.hpp"

namespace {

/// c0 + x (c1 + x (c2 + ...))
template <typename V, std::size_t N>
inline V polynomial(V x, const double (&coefficients)[N]) noexcept {
  V sum = all<V>(coefficients[N - 1]);
  for (std::size_t i = N - 1; i > 0; --i) sum = fused(sum, x, all<V>(coefficients[i - 1]));
  return sum;
}

/// To the nearest whole number, |x| < 2⁵¹.
template <typename V>
inline V nearest(V x) noexcept {
  const V far = all<V>(6755399441055744.0);  // 1.5 · 2⁵²
  return (x + far) - far;
}

constexpr double not_a_number = NAN;
constexpr double sine_terms[] = {-1.66666666666666324348e-01, 8.33333333332248946124e-03,
                                 -1.98412698298579493134e-04, 2.75573137070700676789e-06,
                                 -2.50507602534068634195e-08, 1.58969099521155010221e-10};
constexpr double cosine_terms[] = {4.16666666666666019037e-02, -1.38888888888741095749e-03,
                                   2.48015872894767294178e-05, -2.75573143513906633035e-07,
                                   2.08757232129817482790e-09, -1.13596475577881948265e-11};

template <typename V>
inline void one_cosine_and_sine(V x, V& cosine, V& sine) noexcept {
  const V k = nearest(x * all<V>(6.36619772367581382433e-01));
  V r = x - k * all<V>(1.57079632673412561417e+00);
  r = r - k * all<V>(6.07710050630396597660e-11);
  r = r - k * all<V>(2.02226624879595063154e-21);
  const V rr = r * r;
  const V s = fused(rr * r, polynomial(rr, sine_terms), r);
  const V c = fused(rr * rr, polynomial(rr, cosine_terms), all<V>(1.0) - all<V>(0.5) * rr);

  const V j = k - all<V>(4.0) * nearest(all<V>(0.25) * k);  // k mod 4 as -2 .. 2
  const V jj = j * j;
  const V is_odd = jj * (all<V>(4.0) - jj);       // 3 at odd k, else 0
  const V sign = all<V>(1.0) - all<V>(0.5) * jj;  // of even k
  const V valid = select_less(x * x, all<V>(1.000001e12), all<V>(0.0), all<V>(not_a_number));
  cosine = select_less(is_odd, all<V>(1.0), c * sign, -(s * j)) + valid;
  sine = select_less(is_odd, all<V>(1.0), s * sign, c * j) + valid;
}

void cosine_and_sine(const double* angle, std::size_t samples, double* cosine,
                     double* sine) noexcept {
  const std::size_t bulk = samples / width * width;
  Lanes c, s;
  for (std::size_t k = 0; k < bulk; k += width) {
    one_cosine_and_sine(load<Lanes>(angle + k), c, s);
    store(cosine + k, c);
    store(sine + k, s);
  }
  for (std::size_t k = bulk; k < samples; ++k) {
    one_cosine_and_sine(angle[k], cosine[k], sine[k]);
  }
}

}  // namespace
