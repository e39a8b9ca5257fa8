#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <Eigen/Geometry>

#include "verify/detail/box_tree.h"
#include "verify/detail/surface_reference.h"

namespace crosstie::verify::detail {
namespace {

/// Part of a triangle: its inside, an edge (from corner k to k + 1) or a corner k.
struct Nearest {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  int edge = -1;
  int corner = -1;
};

/// Closest point of a triangle by the regions of its barycentric coordinates (Ericson, Real-Time Collision Detection, 2005, section 5.1.5).
Nearest nearest_of_triangle(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                            const Eigen::Vector3d& p) {
  const Eigen::Vector3d ab = b - a;
  const Eigen::Vector3d ac = c - a;
  const double d1 = ab.dot(p - a);
  const double d2 = ac.dot(p - a);
  if (d1 <= 0.0 && d2 <= 0.0) return {a, -1, 0};
  const double d3 = ab.dot(p - b);
  const double d4 = ac.dot(p - b);
  if (d3 >= 0.0 && d4 <= d3) return {b, -1, 1};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) return {a + d1 / (d1 - d3) * ab, 0, -1};
  const double d5 = ab.dot(p - c);
  const double d6 = ac.dot(p - c);
  if (d6 >= 0.0 && d5 <= d6) return {c, -1, 2};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) return {a + d2 / (d2 - d6) * ac, 2, -1};
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0) return {b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b), 1, -1};
  const double all = va + vb + vc;
  return {a + vb / all * ab + vc / all * ac, -1, -1};
}

class MeshReference final : public SurfaceReference {
 public:
  explicit MeshReference(const base::Mesh& mesh) : mesh_(mesh), tree_(boxes(mesh)) {
    const auto& points = mesh.vertices.points;
    // Meshes of triangles that share no vertices are joined by place.
    std::map<std::array<double, 3>, std::uint32_t> places;
    place_.resize(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto [at, fresh] = places.try_emplace({points[i].x(), points[i].y(), points[i].z()}, static_cast<std::uint32_t>(i));
      place_[i] = at->second;
    }
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> uses;
    for (const auto& t : mesh.triangles) {
      for (std::size_t k = 0; k < 3; ++k) ++uses[edge_of(t[k], t[(k + 1) % 3])];
    }
    border_vertex_.assign(points.size(), 0);
    for (const auto& [edge, count] : uses) {
      if (count != 1) continue;
      border_edges_.push_back(edge);
      border_vertex_[edge.first] = border_vertex_[edge.second] = 1;
    }
    vertex_normals_.assign(points.size(), Eigen::Vector3d::Zero());
    for (const auto& t : mesh.triangles) {
      const Eigen::Vector3d area = (points[t[1]] - points[t[0]]).cross(points[t[2]] - points[t[0]]);
      for (const std::uint32_t v : t) vertex_normals_[place_[v]] += area;
    }
  }

  std::optional<SurfaceFoot> foot(const Eigen::Vector3d& p, const Eigen::Vector3d& side, double gate_mm) const override {
    (void)side;
    const auto& points = mesh_.vertices.points;
    const auto of = [&](std::size_t i) {
      const auto& t = mesh_.triangles[i];
      return nearest_of_triangle(points[t[0]], points[t[1]], points[t[2]], p);
    };
    const auto hits = tree_.nearest(p, 1, gate_mm * gate_mm, [&](std::size_t i) { return (of(i).point - p).squaredNorm(); });
    if (hits.empty()) return std::nullopt;
    const auto& t = mesh_.triangles[hits[0].index];
    const Nearest near = of(hits[0].index);
    SurfaceFoot foot;
    foot.point = near.point;
    foot.normal = (points[t[1]] - points[t[0]]).cross(points[t[2]] - points[t[0]]).normalized();
    if (near.corner >= 0) {
      const std::uint32_t v = place_[t[static_cast<std::size_t>(near.corner)]];
      foot.on_border = border_vertex_[v] != 0;
      if (vertex_normals_[v].norm() > 0.0) foot.normal = vertex_normals_[v].normalized();
    } else if (near.edge >= 0) {
      const auto k = static_cast<std::size_t>(near.edge);
      foot.on_border = std::binary_search(border_edges_.begin(), border_edges_.end(), edge_of(t[k], t[(k + 1) % 3]));
    }
    const Eigen::Vector3d off = p - near.point;
    foot.signed_mm = std::copysign(off.norm(), off.dot(foot.normal));
    return foot;
  }

 private:
  static std::vector<Box> boxes(const base::Mesh& mesh) {
    std::vector<Box> all(mesh.triangles.size());
    for (std::size_t i = 0; i < all.size(); ++i) {
      for (const std::uint32_t v : mesh.triangles[i]) all[i].add(mesh.vertices.points[v]);
    }
    return all;
  }
  [[nodiscard]] std::pair<std::uint32_t, std::uint32_t> edge_of(std::uint32_t a, std::uint32_t b) const {
    return std::minmax({place_[a], place_[b]});
  }

  const base::Mesh& mesh_;
  BoxTree tree_;
  std::vector<std::uint32_t> place_;                                   ///< the first vertex in the same place
  std::vector<std::pair<std::uint32_t, std::uint32_t>> border_edges_;  ///< sorted
  std::vector<char> border_vertex_;
  std::vector<Eigen::Vector3d> vertex_normals_;
};

}  // namespace

std::unique_ptr<SurfaceReference> mesh_reference(const base::Mesh& mesh) { return std::make_unique<MeshReference>(mesh); }

}  // namespace crosstie::verify::detail
