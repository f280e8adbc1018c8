// Compares orderings of the normal equations of a trajectory (CN-20) with a chain, 2x2 registrations at all places,
// positions and attitudes, and six unknowns per frame. CHOLMOD orders, factors and solves them. The ordering is that of
// the graph of frames, with one node for six unknowns. Seconds are processor time.
//
//   megablock simulate --scene stereopolis --frames 44633 --drives 4 --points-per-frame 10 -o town
//   compare_ordering town/block.yaml [d_cons = 3]
#include <cholmod.h>
#include <omp.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>

#include "adjust/registration/trajectory.h"
#include "geometry/numbers/angles.h"
#include "geometry/transform/rotation.h"
#include "io/base/error.h"
#include "io/project/project.h"
#include "merge/tree/stopwatch.h"
#include "partition/candidates/places.h"

extern "C" void openblas_set_num_threads(int threads);

namespace {

using namespace megablock;

double processor_seconds() {
  timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

class Stopwatch {
 public:
  double lap() {
    const double now = processor_seconds(), seconds = now - begun_;
    begun_ = now;
    return seconds;
  }

 private:
  double begun_ = processor_seconds();
};

struct Link {
  int from, to;
  double position_sigma_m, rotation_sigma_rad;
  auto operator<=>(const Link&) const = default;
};

// A trajectory's normal equations at its start: blocks of the lower triangle by column, [frames] and [links].
struct Normal {
  std::vector<Matrix6> diagonal;
  std::vector<Link> links;  // from < to, ascending
  std::vector<Matrix6> off_diagonal;
};

// Derivatives of a relative pose by the two poses' increments, at its own value.
void add_link(const Link& link, const std::vector<Pose>& frames, Normal& normal) {
  const Pose &from = frames[static_cast<std::size_t>(link.from)], &to = frames[static_cast<std::size_t>(link.to)];
  const Eigen::Matrix3d turn = from.rotation.toRotationMatrix();
  Matrix6 by_from = Matrix6::Zero(), by_to = Matrix6::Zero();
  by_to.topLeftCorner<3, 3>() = to.rotation.toRotationMatrix() / link.rotation_sigma_rad;
  by_from.topLeftCorner<3, 3>() = -by_to.topLeftCorner<3, 3>();
  by_to.bottomRightCorner<3, 3>() = turn / link.position_sigma_m;
  by_from.bottomRightCorner<3, 3>() = -by_to.bottomRightCorner<3, 3>();
  // The increment turns the base in the axes of `from`.
  by_from.bottomLeftCorner<3, 3>() = skew<double>(turn * (to.centre - from.centre)) * turn / -link.position_sigma_m;
  normal.diagonal[static_cast<std::size_t>(link.from)] += by_from.transpose() * by_from;
  normal.diagonal[static_cast<std::size_t>(link.to)] += by_to.transpose() * by_to;
  normal.off_diagonal.push_back(by_to.transpose() * by_from);
}

Normal normal_of(const Trajectory& trajectory, int spacing) {
  const JointInput& input = trajectory.input;
  Normal normal;
  for (const ChainLink& link : input.chain) {
    const auto [low, high] = std::minmax({static_cast<int>(link.from.value), static_cast<int>(link.to.value)});
    normal.links.push_back({low, high, link.position_sigma_m, link.rotation_sigma_rad});
  }
  PlaceOptions options;
  options.registration_spacing = spacing;
  std::vector<Eigen::Vector3d> positions;
  for (const Pose& pose : input.start) positions.push_back(pose.centre);
  const std::size_t chain = normal.links.size();
  for (const Place& place : choose_places(positions, input.pass, panorama_graph(positions, options), options)) {
    const auto [low, high] = std::minmax({static_cast<int>(place.a.value), static_cast<int>(place.c.value)});
    normal.links.push_back({low, high, 0.006, 0.015 * kDegree});
  }
  std::sort(normal.links.begin(), normal.links.end());
  const auto same = [](const Link& a, const Link& b) { return a.from == b.from && a.to == b.to; };
  normal.links.erase(std::unique(normal.links.begin(), normal.links.end(), same), normal.links.end());
  std::printf("d_cons %d: %zu frames, %zu unknowns, %zu links of the chain, %zu registrations\n", spacing,
              positions.size(), 6 * positions.size(), chain, normal.links.size() - chain);
  Matrix6 absolute = Matrix6::Zero();
  absolute.diagonal() << Eigen::Vector3d::Constant(std::pow(0.05 * kDegree, -2) / 50),
      Eigen::Vector3d::Constant(1 / (2.0 * 2.0 * 50));
  normal.diagonal.assign(positions.size(), absolute);
  for (const Link& link : normal.links) add_link(link, input.start, normal);
  return normal;
}

// Lower triangle of the graph of frames.
cholmod_sparse* graph_of(const Normal& normal, cholmod_common& common) {
  const std::size_t frames = normal.diagonal.size();
  cholmod_sparse* graph =
      cholmod_allocate_sparse(frames, frames, frames + normal.links.size(), 1, 1, -1, CHOLMOD_PATTERN, &common);
  auto* column = static_cast<int*>(graph->p);
  auto* row = static_cast<int*>(graph->i);
  std::size_t link = 0;
  int next = 0;
  for (std::size_t f = 0; f < frames; ++f) {
    column[f] = next;
    row[next++] = static_cast<int>(f);
    for (; link < normal.links.size() && normal.links[link].from == static_cast<int>(f); ++link)
      row[next++] = normal.links[link].to;
  }
  column[frames] = next;
  return graph;
}

// Lower triangle of the equations with their frames in the order `frame_at`.
cholmod_sparse* matrix_of(const Normal& normal, const std::vector<int>& frame_at, cholmod_common& common) {
  const std::size_t frames = normal.diagonal.size();
  std::vector<int> place(frames);
  for (std::size_t k = 0; k < frames; ++k) place[static_cast<std::size_t>(frame_at[k])] = static_cast<int>(k);
  std::vector<std::vector<std::pair<int, std::size_t>>> below(frames);  // row, link
  for (std::size_t i = 0; i < normal.links.size(); ++i) {
    const auto [low, high] = std::minmax(place[static_cast<std::size_t>(normal.links[i].from)],
                                         place[static_cast<std::size_t>(normal.links[i].to)]);
    below[static_cast<std::size_t>(low)].emplace_back(high, i);
  }
  cholmod_sparse* matrix = cholmod_allocate_sparse(6 * frames, 6 * frames, 21 * frames + 36 * normal.links.size(), 1, 1,
                                                   -1, CHOLMOD_REAL, &common);
  auto* column = static_cast<int*>(matrix->p);
  auto* row = static_cast<int*>(matrix->i);
  auto* value = static_cast<double*>(matrix->x);
  int next = 0;
  for (std::size_t k = 0; k < frames; ++k) {
    std::sort(below[k].begin(), below[k].end());
    for (int c = 0; c < 6; ++c) {
      *column++ = next;
      const auto put = [&](std::size_t block, int r, double v) {
        row[next] = static_cast<int>(6 * block) + r;
        value[next++] = v;
      };
      for (int r = c; r < 6; ++r) put(k, r, normal.diagonal[static_cast<std::size_t>(frame_at[k])](r, c));
      for (const auto& [to, link] : below[k]) {
        const bool upright = place[static_cast<std::size_t>(normal.links[link].from)] == static_cast<int>(k);
        for (int r = 0; r < 6; ++r)
          put(static_cast<std::size_t>(to), r,
              upright ? normal.off_diagonal[link](r, c) : normal.off_diagonal[link](c, r));
      }
    }
  }
  *column = next;
  return matrix;
}

enum class Order { kAmd, kMetis, kNestedDissection };

std::vector<int> order(cholmod_sparse* graph, Order how, cholmod_common& common) {
  std::vector<int> frames(graph->nrow), parent(graph->nrow), member(graph->nrow);
  if (how == Order::kAmd) cholmod_amd(graph, nullptr, 0, frames.data(), &common);
  if (how == Order::kMetis) cholmod_metis(graph, nullptr, 0, 0, frames.data(), &common);
  if (how == Order::kNestedDissection)
    cholmod_nested_dissection(graph, nullptr, 0, frames.data(), parent.data(), member.data(), &common);
  if (common.status < 0) throw ComputeError("CHOLMOD cannot order the graph");
  return frames;
}

// || A x - b || / || b ||
double residual_of(cholmod_sparse* matrix, cholmod_dense* x, cholmod_dense* b, cholmod_common& common) {
  double one[2] = {1, 0}, minus[2] = {-1, 0};
  cholmod_dense* r = cholmod_copy_dense(b, &common);
  cholmod_sdmult(matrix, 0, one, minus, x, r, &common);
  const double residual = cholmod_norm_dense(r, 2, &common) / cholmod_norm_dense(b, 2, &common);
  cholmod_free_dense(&r, &common);
  return residual;
}

void compare(const Normal& normal, const char* name, Order how, cholmod_common& common) {
  cholmod_sparse* graph = graph_of(normal, common);
  Stopwatch watch;
  const std::vector<int> frames = order(graph, how, common);
  const double ordered = watch.lap();
  cholmod_sparse* matrix = matrix_of(normal, frames, common);
  watch.lap();
  cholmod_factor* factor = cholmod_analyze(matrix, &common);
  const double analysed = watch.lap();
  cholmod_factorize(matrix, factor, &common);
  if (common.status != CHOLMOD_OK) throw ComputeError("CHOLMOD cannot factor the normal equations");
  const double factored = watch.lap();
  cholmod_dense* b = cholmod_ones(matrix->nrow, 1, CHOLMOD_REAL, &common);
  watch.lap();
  cholmod_dense* x = cholmod_solve(CHOLMOD_A, factor, b, &common);
  const double solved = watch.lap();
  std::printf(
      "%-18s ordered %.3f s, analysed %.3f s, factored %.3f s, solved %.3f s: together %.3f s; "
      "%.1f million numbers in the factor, residual %.1e\n",
      name, ordered, analysed, factored, solved, ordered + analysed + factored + solved, common.lnz / 1e6,
      residual_of(matrix, x, b, common));
  cholmod_free_dense(&x, &common);
  cholmod_free_dense(&b, &common);
  cholmod_free_factor(&factor, &common);
  cholmod_free_sparse(&matrix, &common);
  cholmod_free_sparse(&graph, &common);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return std::fprintf(stderr, "compare_ordering BLOCK.yaml [d_cons]\n"), 2;
  openblas_set_num_threads(1);
  omp_set_max_active_levels(0);  // CHOLMOD asks for four threads at every supernode
  try {
    const Trajectory trajectory = trajectory_of(read_project(argv[1]).block, {});
    const Normal normal = normal_of(trajectory, argc > 2 ? std::atoi(argv[2]) : 3);
    cholmod_common common;
    cholmod_start(&common);
    common.nmethods = 1;
    common.method[0].ordering = CHOLMOD_NATURAL;  // the frames are in order
    common.postorder = 1;
    common.supernodal = CHOLMOD_SUPERNODAL;
    compare(normal, "minimum degree", Order::kAmd, common);
    compare(normal, "METIS", Order::kMetis, common);
    compare(normal, "nested dissection", Order::kNestedDissection, common);
    cholmod_finish(&common);
  } catch (const Error& error) {
    std::fprintf(stderr, "compare_ordering: %s\n", error.what());
    return 1;
  }
}
