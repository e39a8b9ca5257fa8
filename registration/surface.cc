#include "registration/surface.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <nanoflann.hpp>

#include "math/median.h"

namespace crosstie::registration {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;
using Eigen::Vector3d;

constexpr int kLeastInCell = 6;            // a plane has three parameters, its scatter needs some more
constexpr double kLine = 0.05;             // second over first variance in a piece: below, its points lie on a line
constexpr double kThick = 0.1;             // third over second: above, they do not lie in a plane
constexpr std::size_t kLeastPoints = 100;  // of a cloud
constexpr std::size_t kSample = 20000;     // points by which the cells are chosen
constexpr double kPooledCells = 20.0;      // weight of the common scatter against that of a cell, in degrees of freedom
constexpr double kNeighbourCells = 1.9;    // reach of neighbours, in cells
constexpr double kGap_rad = 2.0 * std::numbers::pi / 3.0;  // without neighbours: a border
constexpr std::int64_t kMostCells = 1 << 21;               // along an axis
constexpr std::size_t kLeastNeighbours = 4;                // that tell a curvature
constexpr double kBent_rad = 0.5;                          // normals that differ by more belong to different surfaces
constexpr int kUnbendRounds = 2;
constexpr double kUniformFourth = 0.2;  // variance of half a square of a uniform variable over its variance squared

/// The grid's axes against the cloud's: no part of a machine lies along them.
Eigen::Matrix3d grid_axes() {
  return Eigen::AngleAxisd(0.7548776662, Vector3d(0.41, -0.53, 0.742).normalized()).toRotationMatrix();
}

/// Cell of each point as one number, with the point's index; sorted.
using Keyed = std::vector<std::pair<std::uint64_t, std::uint32_t>>;

Keyed keys(const std::vector<Vector3d>& turned, const Vector3d& least, double cell_mm, std::size_t every) {
  Keyed keyed;
  keyed.reserve(turned.size() / every + 1);
  for (std::size_t i = 0; i < turned.size(); i += every) {
    const Vector3d at = (turned[i] - least) / cell_mm;
    const auto x = static_cast<std::uint64_t>(at.x());
    const auto y = static_cast<std::uint64_t>(at.y());
    const auto z = static_cast<std::uint64_t>(at.z());
    keyed.emplace_back((x << 42U) | (y << 21U) | z, static_cast<std::uint32_t>(i));
  }
  std::sort(keyed.begin(), keyed.end());
  return keyed;
}

std::size_t cells_of(const Keyed& keyed) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < keyed.size(); ++i) count += i == 0 || keyed[i].first != keyed[i - 1].first ? 1U : 0U;
  return count;
}

/// The edge with which about as many cells are filled as wanted: the surface's area is told by a coarser grid that leaves no holes.
double choose_cell(const std::vector<Vector3d>& turned, const Vector3d& least, double size_mm, double wanted) {
  constexpr double kFull = 12.0;  // points in a cell: hardly one of the surface's cells is then empty
  const std::size_t every = std::max<std::size_t>(1, turned.size() / kSample);
  const double count = static_cast<double>((turned.size() + every - 1) / every);
  double cell = size_mm / 40.0;
  std::size_t filled = 1;
  for (int round = 0; round < 6; ++round) {
    filled = std::max<std::size_t>(1, cells_of(keys(turned, least, cell, every)));
    const double mean = count / static_cast<double>(filled);
    if (mean > 0.7 * kFull && mean < 1.5 * kFull) break;
    cell *= std::clamp(std::sqrt(kFull / mean), 0.2, 5.0);
  }
  return cell * std::sqrt(static_cast<double>(filled) / wanted);
}

const std::vector<double>* field(const base::Cloud& cloud, std::string_view name) {
  for (const base::CloudField& candidate : cloud.fields) {
    if (candidate.name == name) return &candidate.values;
  }
  return nullptr;
}

std::uint64_t fingerprint_of(const std::vector<Vector3d>& points) {
  std::uint64_t hash = 0xcbf29ce484222325ULL ^ points.size();
  for (const Vector3d& point : points) {
    for (const double value : {point.x(), point.y(), point.z()}) {
      hash ^= std::bit_cast<std::uint64_t>(value);
      hash *= 0x9e3779b97f4a7c15ULL;
      hash ^= hash >> 29U;
    }
  }
  return hash;
}

/// Median of chi-square over its degrees of freedom (Wilson & Hilferty, PNAS 17, 1931).
double chi_square_median(double dof) { return std::pow(1.0 - 2.0 / (9.0 * dof), 3); }

}  // namespace

struct Surface::Tree {
  std::vector<Vector3d> points;

  // What nanoflann asks for.
  [[nodiscard]] std::size_t kdtree_get_point_count() const { return points.size(); }
  [[nodiscard]] double kdtree_get_pt(std::size_t at, std::size_t axis) const {
    return points[at][static_cast<Eigen::Index>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }

  using Index = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Tree>, Tree, 3, std::uint32_t>;
  std::unique_ptr<Index> index;
};

/// How the points of a piece are spread in its plane.
struct Surface::Moments {
  Vector3d u, v;  ///< axes in the plane
  Eigen::Matrix2d second = Eigen::Matrix2d::Zero();
  std::array<double, 4> third = {};  ///< means of uuu, uuv, uvv, vvv
  Vector3d mean;                     ///< of the points
  Vector3d plane;                    ///< normal of their plane
  double steadied = 1.0;             ///< sigma of the normal with its neighbours' help over that without
  double scatter_mm2 = 0.0;          ///< about it
};

Result<> SurfaceOptions::validate() const {
  const auto bad = [](const std::string& what) { return fail(ErrorCode::kUsage, "surface options: " + what); };
  if (!(cell_mm >= 0.0) || !std::isfinite(cell_mm)) return bad(fmt::format("cell_mm is {}, it must not be negative", cell_mm));
  if (!(points_per_cell >= kLeastInCell))
    return bad(fmt::format("points_per_cell is {}, at least 6 are needed", points_per_cell));
  if (max_pieces < 100) return bad(fmt::format("max_pieces is {}, at least 100 are needed", max_pieces));
  if (sigma_mm && !(*sigma_mm > 0.0)) return bad(fmt::format("sigma_mm is {}, it must be positive", *sigma_mm));
  return {};
}

Result<Surface> Surface::make(const base::Cloud& cloud, const SurfaceOptions& options) {
  if (auto ok = options.validate(); !ok) return fail(std::move(ok));
  if (cloud.points.size() < kLeastPoints) {
    return fail(ErrorCode::kBadInput,
                fmt::format("a cloud of {} points; at least {} are needed", cloud.points.size(), kLeastPoints));
  }
  const Eigen::Matrix3d axes = grid_axes();
  std::vector<Vector3d> turned(cloud.points.size());
  Vector3d least = Vector3d::Constant(std::numeric_limits<double>::infinity());
  Vector3d most = -least;
  Surface surface;
  surface.points_ = cloud.points.size();
  surface.least_mm_ = least;
  surface.most_mm_ = most;
  for (std::size_t i = 0; i < turned.size(); ++i) {
    const Vector3d& point = cloud.points[i];
    if (!point.allFinite()) return fail(ErrorCode::kBadInput, fmt::format("point {} of the cloud is not finite", i));
    turned[i] = axes * point;
    least = least.cwiseMin(turned[i]);
    most = most.cwiseMax(turned[i]);
    surface.least_mm_ = surface.least_mm_.cwiseMin(point);
    surface.most_mm_ = surface.most_mm_.cwiseMax(point);
    surface.centre_mm_ += point / static_cast<double>(turned.size());
  }
  const double size = (most - least).maxCoeff();
  if (!(size > 0.0)) return fail(ErrorCode::kBadInput, "all points of the cloud are the same");
  const double wanted =
      std::min(static_cast<double>(turned.size()) / options.points_per_cell, static_cast<double>(options.max_pieces));
  const double cell = options.cell_mm > 0.0 ? options.cell_mm : choose_cell(turned, least, size, wanted);
  if (size / cell >= static_cast<double>(kMostCells)) {
    return fail(ErrorCode::kBadInput, fmt::format("cells of {} mm are too small for a cloud of {:.0f} mm", cell, size));
  }
  surface.cell_mm_ = cell;
  surface.fingerprint_ = fingerprint_of(cloud.points);
  surface.oriented_ = !cloud.normals.empty() || cloud.frame == "rig";
  const std::vector<double>* stated = field(cloud, "sigma_mm");
  const bool along_ray = cloud.frame == "rig";

  const Keyed keyed = keys(turned, least, cell, 1);
  std::vector<Moments> shapes;  // of each piece
  std::vector<double> known;    // the same as stated, 0: not known
  std::vector<double> spreads;  // mean of the inverse in-plane variances
  for (std::size_t begin = 0; begin < keyed.size();) {
    std::size_t end = begin;
    Vector3d sum = Vector3d::Zero();
    for (; end < keyed.size() && keyed[end].first == keyed[begin].first; ++end) sum += cloud.points[keyed[end].second];
    const std::size_t first = std::exchange(begin, end);
    const auto count = static_cast<int>(end - first);
    if (count < kLeastInCell) continue;
    SurfacePiece piece;
    piece.count = count;
    piece.point_mm = sum / count;
    Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
    for (std::size_t i = first; i < end; ++i) {
      const Vector3d off = cloud.points[keyed[i].second] - piece.point_mm;
      moments += off * off.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(moments / count);
    const Vector3d& spread = eigen.eigenvalues();
    if (spread(1) < kLine * spread(2) || spread(0) > kThick * spread(1)) continue;
    piece.normal = eigen.eigenvectors().col(0);
    Vector3d towards = -piece.point_mm;
    if (!cloud.normals.empty()) {
      towards.setZero();
      for (std::size_t i = first; i < end; ++i) towards += cloud.normals[keyed[i].second];
    }
    if (piece.normal.dot(towards) < 0.0) piece.normal = -piece.normal;
    double variance = 0.0;
    if (options.sigma_mm) {
      variance = *options.sigma_mm * *options.sigma_mm;
    } else if (stated != nullptr) {
      for (std::size_t i = first; i < end; ++i) {
        const std::size_t at = keyed[i].second;
        const double sigma = (*stated)[at] * (along_ray ? std::abs(cloud.points[at].normalized().dot(piece.normal)) : 1.0);
        variance += sigma * sigma / count;
      }
    }
    known.push_back(variance);
    Moments& shape = shapes.emplace_back();
    shape.mean = piece.point_mm;
    shape.plane = piece.normal;
    shape.u = eigen.eigenvectors().col(2);
    shape.v = piece.normal.cross(shape.u);
    shape.second << spread(2), 0.0, 0.0, spread(1);
    shape.scatter_mm2 = spread(0) * count / (count - 3.0);
    for (std::size_t i = first; i < end; ++i) {
      const Vector3d off = cloud.points[keyed[i].second] - piece.point_mm;
      const double x = shape.u.dot(off);
      const double y = shape.v.dot(off);
      shape.third[0] += x * x * x / count;
      shape.third[1] += x * x * y / count;
      shape.third[2] += x * y * y / count;
      shape.third[3] += y * y * y / count;
    }
    spreads.push_back(0.5 / spread(1) + 0.5 / spread(2));
    surface.pieces_.push_back(piece);
  }
  if (surface.pieces_.empty()) {
    return fail(ErrorCode::kBadInput,
                fmt::format("no cell of {:.3f} mm holds a piece of surface: the cloud is too sparse or too rough", cell));
  }
  surface.build_tree();
  std::vector<double> variances;  // of each piece, of a point round its plane
  for (const Moments& shape : shapes) variances.push_back(shape.scatter_mm2);
  {
    std::vector<double> bent = variances;
    surface.unbend(shapes);
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      const double height = (surface.pieces_[i].point_mm - shapes[i].mean).norm();  // half of trace(K C)
      const double curved = 4.0 * kUniformFourth * height * height;
      const double dof = surface.pieces_[i].count - 3.0;
      variances[i] = std::max(0.1 * bent[i], bent[i] - curved) / chi_square_median(dof);
    }
  }
  const double common = math::median(variances);
  std::vector<double> noise;
  for (std::size_t i = 0; i < surface.pieces_.size(); ++i) {
    SurfacePiece& piece = surface.pieces_[i];
    const double dof = piece.count - 3.0;
    const double observed = (kPooledCells * common + dof * variances[i] * chi_square_median(dof)) / (kPooledCells + dof);
    const double variance = options.sigma_mm ? known[i] : std::max(known[i], observed);
    noise.push_back(std::sqrt(variance));
    piece.sigma_mm = std::sqrt(variance / piece.count);
    piece.tilt_rad = shapes[i].steadied * std::sqrt(variance / piece.count * spreads[i]);
  }
  surface.noise_mm_ = math::median(std::move(noise));

  surface.find_borders();
  return surface;
}

void Surface::build_tree() {
  auto tree = std::make_shared<Tree>();
  tree->points.reserve(pieces_.size());
  for (const SurfacePiece& piece : pieces_) tree->points.push_back(piece.point_mm);
  tree->index = std::make_unique<Tree::Index>(3, *tree, nanoflann::KDTreeSingleIndexAdaptorParams(8));
  tree->index->buildIndex();
  tree_ = std::move(tree);
}

/// With heights z = -x'K x / 2 over a piece's tangent plane (K positive where the surface bends away from the normal's side) the normals are
/// n(x) = n + K x. K comes from the neighbours' normals.
void Surface::unbend(std::vector<Moments>& moments) {
  using Matrix5d = Eigen::Matrix<double, 5, 5>;
  using Vector5d = Eigen::Matrix<double, 5, 1>;
  std::vector<Vector3d> raw(pieces_.size());  // normals without their neighbours' help
  for (std::size_t i = 0; i < pieces_.size(); ++i) raw[i] = pieces_[i].normal;
  const double reach = kNeighbourCells * cell_mm_;
  const nanoflann::SearchParams unsorted(32, 0.0F, false);
  std::vector<std::pair<std::uint32_t, double>> near;
  for (int round = 0; round < kUnbendRounds; ++round) {
    const std::vector<Vector3d> before = raw;
    const bool last = round + 1 == kUnbendRounds;
    for (std::size_t i = 0; i < pieces_.size(); ++i) {
      const Moments& shape = moments[i];
      near.clear();
      tree_->index->radiusSearch(shape.mean.data(), reach * reach, near, unsorted);
      std::sort(near.begin(), near.end());
      // Unknown: K uu, uv, vv over a cell, and the correction of this normal; its own observation is that there is none.
      Matrix5d normal = Matrix5d::Zero();
      normal.bottomRightCorner<2, 2>().setIdentity();
      Vector5d right = Vector5d::Zero();
      std::size_t used = 0;
      for (const auto& [other, square] : near) {
        if (other == i) continue;
        const double cosine = before[other].dot(before[i]);
        if (std::abs(cosine) < std::cos(kBent_rad)) continue;
        const Vector3d off = (moments[other].mean - shape.mean) / cell_mm_;
        const Vector3d change = (cosine < 0.0 ? Vector3d(-before[other]) : before[other]) - before[i];
        const Eigen::Vector2d at(shape.u.dot(off), shape.v.dot(off));
        const Eigen::Vector2d bend(shape.u.dot(change), shape.v.dot(change));
        Eigen::Matrix<double, 2, 5> rows;
        rows << at.x(), at.y(), 0.0, 1.0, 0.0, 0.0, at.x(), at.y(), 0.0, 1.0;
        normal += rows.transpose() * rows;
        right += rows.transpose() * bend;
        ++used;
      }
      if (used < kLeastNeighbours) continue;
      const Eigen::LDLT<Matrix5d> ldlt(normal);
      if (ldlt.info() != Eigen::Success || ldlt.vectorD().minCoeff() < 1e-3 * ldlt.vectorD().maxCoeff()) continue;
      const Vector5d solved = ldlt.solve(right);
      const Vector3d k = solved.head<3>() / cell_mm_;
      const double below = 0.5 * (k(0) * shape.second(0, 0) + k(2) * shape.second(1, 1));
      // Slope of the plane through z = -x'K x / 2: C^-1 mean(x z).
      const auto& t = shape.third;
      const Eigen::Vector2d mixed(-0.5 * (k(0) * t[0] + 2.0 * k(1) * t[1] + k(2) * t[2]),
                                  -0.5 * (k(0) * t[1] + 2.0 * k(1) * t[2] + k(2) * t[3]));
      const Eigen::Vector2d slope(mixed.x() / shape.second(0, 0), mixed.y() / shape.second(1, 1));
      pieces_[i].point_mm = shape.mean + below * shape.plane;
      // A plane z = s x has the normal (-s, 1); the slope that the bend makes is taken away.
      raw[i] = (shape.plane + slope.x() * shape.u + slope.y() * shape.v).normalized();
      if (!last) continue;
      pieces_[i].normal = (raw[i] + solved(3) * shape.u + solved(4) * shape.v).normalized();
      const Matrix5d inverse = ldlt.solve(Matrix5d::Identity());
      moments[i].steadied = std::sqrt(0.5 * (inverse(3, 3) + inverse(4, 4)));
    }
  }
}

int Surface::nearest(const Vector3d& point_mm, double radius_mm) const {
  std::uint32_t index = 0;
  double square = radius_mm * radius_mm;
  nanoflann::KNNResultSet<double, std::uint32_t> found(1);
  found.init(&index, &square);
  square = radius_mm * radius_mm;
  tree_->index->findNeighbors(found, point_mm.data(), nanoflann::SearchParams());
  return found.size() == 1 && square < radius_mm * radius_mm ? static_cast<int>(index) : -1;
}

void Surface::find_borders() {
  const double reach = kNeighbourCells * cell_mm_;
  std::vector<std::pair<std::uint32_t, double>> near;
  std::vector<double> angles;
  const nanoflann::SearchParams unsorted(32, 0.0F, false);
  for (SurfacePiece& piece : pieces_) {
    near.clear();
    tree_->index->radiusSearch(piece.point_mm.data(), reach * reach, near, unsorted);
    const Vector3d u = piece.normal.unitOrthogonal();
    const Vector3d v = piece.normal.cross(u);
    angles.clear();
    for (const auto& [other, square] : near) {
      const Vector3d off = pieces_[other].point_mm - piece.point_mm;
      if (square > 0.0) angles.push_back(std::atan2(v.dot(off), u.dot(off)));
    }
    std::sort(angles.begin(), angles.end());
    double gap = angles.empty() ? 2.0 * std::numbers::pi : angles.front() + 2.0 * std::numbers::pi - angles.back();
    for (std::size_t i = 1; i < angles.size(); ++i) gap = std::max(gap, angles[i] - angles[i - 1]);
    piece.border = gap > kGap_rad;
  }
}

}  // namespace crosstie::registration
