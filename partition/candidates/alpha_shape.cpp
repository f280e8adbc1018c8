// Builds the graph of panoramas by CGAL's alpha shape. This is the only file that includes CGAL, which takes long to
// compile.
//
// CGAL's alpha value is the squared radius. Positions in one plane have no tetrahedra; so each height gets up to a
// millimetre more, depending on the row, before heights are stretched.
#include <CGAL/Alpha_shape_3.h>
#include <CGAL/Alpha_shape_cell_base_3.h>
#include <CGAL/Alpha_shape_vertex_base_3.h>
#include <CGAL/Delaunay_triangulation_3.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Triangulation_vertex_base_with_info_3.h>

#include <algorithm>

#include "partition/candidates/places.h"

namespace megablock {

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using VertexWithRow = CGAL::Triangulation_vertex_base_with_info_3<std::int64_t, Kernel>;
using Vertex = CGAL::Alpha_shape_vertex_base_3<Kernel, VertexWithRow>;
using Cell = CGAL::Alpha_shape_cell_base_3<Kernel>;
using Delaunay = CGAL::Delaunay_triangulation_3<Kernel, CGAL::Triangulation_data_structure_3<Vertex, Cell>>;
using AlphaShape = CGAL::Alpha_shape_3<Delaunay>;

EdgeClass class_of(AlphaShape::Classification_type type) {
  switch (type) {
    case AlphaShape::INTERIOR:
      return EdgeClass::kInterior;
    case AlphaShape::REGULAR:
      return EdgeClass::kNormal;
    case AlphaShape::SINGULAR:
      return EdgeClass::kBorder;
    default:
      return EdgeClass::kExterior;
  }
}

}  // namespace

std::vector<PanoramaEdge> panorama_graph(const std::vector<Eigen::Vector3d>& positions, const PlaceOptions& options) {
  if (positions.size() < 4) return {};
  std::vector<std::pair<Kernel::Point_3, std::int64_t>> points;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Eigen::Vector3d p = positions[i] - positions[0];
    // Multiplication by a large odd number scatters the rows evenly; the result is the same in every run.
    const double unevenness = 1e-3 * static_cast<double>((i * 2654435761u) % 1024) / 1024;
    points.emplace_back(Kernel::Point_3(p.x(), p.y(), options.z_stretch * (p.z() + unevenness)),
                        static_cast<std::int64_t>(i));
  }
  Delaunay delaunay(points.begin(), points.end());
  // All positions in one plane in spite of the unevenness, for example because they coincide.
  if (delaunay.dimension() < 3) return {};
  const AlphaShape shape(delaunay, options.alpha_m * options.alpha_m, AlphaShape::GENERAL);
  std::vector<PanoramaEdge> edges;
  for (auto edge = shape.finite_edges_begin(); edge != shape.finite_edges_end(); ++edge) {
    const EdgeClass kind = class_of(shape.classify(*edge));
    if (kind == EdgeClass::kExterior) continue;
    const std::int64_t i = edge->first->vertex(edge->second)->info(), j = edge->first->vertex(edge->third)->info();
    edges.push_back({std::min(i, j), std::max(i, j), kind});
  }
  std::sort(edges.begin(), edges.end());
  return edges;
}

}  // namespace megablock
