#include "base/detail/lens.h"

namespace crosstie::base::detail {
namespace {

/// The parameters of kAicon by name.
struct Aicon {
  double c, xh, yh, a1, a2, a3, b1, b2, c1, c2, r0, width_mm, height_mm, columns, rows;

  explicit Aicon(const double* p)
      : c(p[0]),
        xh(p[1]),
        yh(p[2]),
        a1(p[3]),
        a2(p[4]),
        a3(p[5]),
        b1(p[6]),
        b2(p[7]),
        c1(p[8]),
        c2(p[9]),
        r0(p[10]),
        width_mm(p[11]),
        height_mm(p[12]),
        columns(p[13]),
        rows(p[14]) {}
};

/// Places in the list of a lens's terms.
enum Term { kFx, kFy, kCx, kCy, kK1, kK2, kP1, kP2, kK3, kK0 = 16, kAffinity, kShear };

}  // namespace

Lens lens_of(LensModel model, const double* parameters) {
  Lens lens;
  if (model != LensModel::kAicon) {
    lens.fx = parameters[0];
    lens.fy = parameters[1];
    lens.cx = parameters[2];
    lens.cy = parameters[3];
    const int count = model.is_splined() ? 4 : parameter_count(model);
    for (int i = 4; i < count; ++i) lens.distortion[static_cast<std::size_t>(i - 4)] = parameters[i];
    return lens;
  }
  const Aicon p(parameters);
  const double cc = p.c * p.c;
  const double rr = p.r0 * p.r0;
  lens.fx = p.c * p.columns / p.width_mm;
  lens.fy = p.c * p.rows / p.height_mm;
  lens.cx = 0.5 * (p.columns - 1.0) + p.xh * p.columns / p.width_mm;
  lens.cy = 0.5 * (p.rows - 1.0) - p.yh * p.rows / p.height_mm;
  // In units of c, with y down.
  Distortion& k = lens.distortion;
  k[kK1 - 4] = p.a1 * cc;
  k[kK2 - 4] = p.a2 * cc * cc;
  k[kK3 - 4] = p.a3 * cc * cc * cc;
  k[kK0 - 4] = -rr * (p.a1 + rr * (p.a2 + rr * p.a3));
  k[kP1 - 4] = -p.b2 * p.c;
  k[kP2 - 4] = p.b1 * p.c;
  k[kAffinity - 4] = p.c1;
  k[kShear - 4] = -p.c2;
  return lens;
}

void aicon_derivatives(const double* parameters, const double* u, const double* v, double* d_parameters) {
  const Aicon p(parameters);
  const double cc = p.c * p.c;
  const double rr = p.r0 * p.r0;
  const double per_x = p.columns / p.width_mm;
  const double per_y = p.rows / p.height_mm;
  const int count = parameter_count(LensModel::kAicon);
  for (int row = 0; row < 2; ++row) {
    const double* by = row == 0 ? u : v;
    double* d = d_parameters + row * count;
    d[0] = by[kFx] * per_x + by[kFy] * per_y + by[kK1] * 2.0 * p.a1 * p.c + by[kK2] * 4.0 * p.a2 * cc * p.c +
           by[kK3] * 6.0 * p.a3 * cc * cc * p.c - by[kP1] * p.b2 + by[kP2] * p.b1;
    d[1] = by[kCx] * per_x;
    d[2] = -by[kCy] * per_y;
    d[3] = by[kK1] * cc - by[kK0] * rr;
    d[4] = by[kK2] * cc * cc - by[kK0] * rr * rr;
    d[5] = by[kK3] * cc * cc * cc - by[kK0] * rr * rr * rr;
    d[6] = by[kP2] * p.c;
    d[7] = -by[kP1] * p.c;
    d[8] = by[kAffinity];
    d[9] = -by[kShear];
    for (int i = 10; i < count; ++i) d[i] = 0.0;
  }
}

}  // namespace crosstie::base::detail
