// Compares the seam check with the best possible test. The observations that a tile has of two separator frames are
// turned by 1e-4 rad (docs/results/whole-blocks.md, "Seam check"), for every tile of every block in turn. The alarm
// limits are those of a block of 200 tiles, whatever the number of tiles.
//
//   compare_seams street|rig|aerial [image_noise_px = 0.5] [blocks = 4]
//   compare_seams clean [blocks = 100]
//
// "ideal" is a test that knows, for each of 200 tiles, which two frames might be turned, and how. With B'AB as the
// information about this one number (merge/checks/seam_check.h), its statistic is normal with the mean sqrt(B'AB). No
// test has more power.
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "adjust/tile/image_sigma.h"
#include "geometry/numbers/chi_square.h"
#include "io/simulate/scene/random.h"
#include "merge/checks/seam_text.h"
#include "tests/support/merge/turned_frames.h"

namespace {

using namespace megablock;

constexpr double kTurn = 1e-4;  // rad
constexpr std::int64_t kTiles = 200;

struct Count {
  int cases = 0, alone = 0, with_another = 0, another = 0, nothing = 0;
  std::int64_t least = std::numeric_limits<std::int64_t>::max(), most = 0;  // observations of the turned frames
  double noncentrality = 0, deviate = 0, power = 0;                         // of the ideal test; sums
};

void adjust(MergeInMemory& runner) {
  GlobalOptions options;
  options.max_decrement = 1e-4;
  GlobalState state = start_global(options);
  adjust_globally(runner, options, state);
  runner.final_up();
}

TiledBlock tiled(const SimulationOptions& options, std::int64_t tile_max_frames) {
  ObservationOptions without_loss;
  without_loss.image_loss.kind = without_loss.position_loss.kind = RobustLoss::Kind::kNone;
  TiledBlock block(simulate_block(options), tile_max_frames, without_loss, 0.02);
  for (TileProblem& problem : block.problems) set_image_sigma(problem, options.image_noise_px);
  return block;
}

// Of a known turn of a tile's two frames.
void add_ideal(const UpdateMatrix& condensed, const CovarianceMatrix& boundary, const SharedFrames& shared,
               const std::array<Eigen::Vector3d, 2>& turns, Count& count) {
  const Eigen::Index n = total_dimension(condensed.unknowns);
  Eigen::MatrixXd s(n, n);
  const double* value = condensed.matrix.data();
  for (Eigen::Index j = 0; j < n; ++j)
    for (Eigen::Index i = j; i < n; ++i) s(i, j) = s(j, i) = *value++;
  const CovarianceMatrix c = boundary.restricted_to(condensed.unknowns);
  const std::vector<std::int64_t> rows = row_offsets(condensed.unknowns);
  Eigen::VectorXd bias = Eigen::VectorXd::Zero(n);
  for (std::size_t i = 0; i < 2; ++i) {
    const auto unknown = find_unknown(condensed.unknowns, {UnknownKind::kFrame, 0, shared.frames[i].value});
    bias.segment<3>(rows[static_cast<std::size_t>(unknown)]) = turns[i];
  }
  const Eigen::VectorXd seen = s * bias;
  const double information = bias.dot(seen) - seen.dot(Eigen::Map<const Eigen::MatrixXd>(c.matrix.data(), n, n) * seen);
  const double score = bias.dot(Eigen::Map<const Eigen::VectorXd>(condensed.rhs.data(), n));
  const double limit = std::sqrt(chi_square_quantile(2 * kSeamAlarmProbability / kTiles, 1));  // one-sided
  count.noncentrality += information;
  count.deviate += score / std::sqrt(information);
  count.power += 0.5 * std::erfc((limit - std::sqrt(information)) / std::sqrt(2.0));
}

std::vector<TileCheck> check(MergeInMemory& runner, std::vector<UpdateMatrix>& condensed,
                             std::vector<CovarianceMatrix>& boundary) {
  std::vector<TileCovariance> covariances = runner.covariances();
  std::vector<TileCheck> checks;
  for (std::size_t t = 0; t < runner.problems().size(); ++t) {
    condensed.push_back(condense_tile(runner.problems()[t], runner.tile_plans()[t], runner.states()[t], 0).update);
    boundary.push_back(std::move(covariances[t].boundary));
    checks.push_back(check_tile(static_cast<std::int64_t>(t), condensed[t], boundary[t],
                                kSeamAlarmProbability / static_cast<double>(kTiles)));
  }
  return checks;
}

void turn_every_tile(const TiledBlock& block, std::uint64_t seed, Count& count) {
  for (std::size_t wrong = 0; wrong < block.problems.size(); ++wrong) {
    const SharedFrames shared = most_shared_frames(block, wrong);
    std::vector<TileProblem> problems = block.problems;
    std::array<Eigen::Vector3d, 2> turns;
    for (std::size_t i = 0; i < 2; ++i) {
      Random random(seed, Random::Purpose::kNoise, 1000000 + 2 * wrong + i);
      turns[i] = kTurn * random.normal3().normalized();
      turn_frame(block, shared.frames[i], turns[i], problems[wrong]);
    }
    MergeInMemory runner(block.tiles.tree, problems, block.states);
    adjust(runner);
    std::vector<UpdateMatrix> condensed;
    std::vector<CovarianceMatrix> boundary;
    const std::vector<std::string> lines = describe_disagreements(check(runner, condensed, boundary));
    ++count.cases;
    count.least = std::min(count.least, shared.observations);
    count.most = std::max(count.most, shared.observations);
    add_ideal(condensed[wrong], boundary[wrong], shared, turns, count);
    const std::string who = lines.empty() ? "" : lines.front().substr(0, lines.front().find(" see"));
    const std::string number = std::to_string(wrong);
    if (lines.empty())
      ++count.nothing;
    else if (who == "tile " + number)
      ++count.alone;
    else if ((who + " ").find(" " + number + " ") != std::string::npos)
      ++count.with_another;
    else
      ++count.another;
  }
}

SimulationOptions scene(const char* name) {
  SimulationOptions options;
  const bool aerial = std::strcmp(name, "aerial") == 0;
  options.scene = aerial ? SimulationOptions::Scene::kAerial : SimulationOptions::Scene::kStreet;
  options.rig_cameras = std::strcmp(name, "rig") == 0 ? 10 : 4;
  options.frames = aerial ? 120 : 60;
  options.gps_sigma_m = 0.2;
  options.calibrate = false;
  return options;
}

void clean(int blocks) {
  int alarms = 0;
  std::size_t tiles = 0;
  for (int seed = 1; seed <= blocks; ++seed) {
    SimulationOptions options = scene(seed % 2 == 0 ? "aerial" : "street");
    options.points_per_frame = 60;
    options.seed = static_cast<std::uint64_t>(seed);
    const TiledBlock block = tiled(options, options.frames / 5);
    MergeInMemory runner(block.tiles.tree, block.problems, block.states);
    adjust(runner);
    alarms += !describe_disagreements(runner.tile_checks()).empty();
    tiles += block.problems.size();
  }
  std::printf("clean: %d of %d blocks, %zu tiles, with an alarm (probability %g of a block)\n", alarms, blocks, tiles,
              kSeamAlarmProbability);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: compare_seams street|rig|aerial [image_noise_px] [blocks] | clean [blocks]\n");
    return 2;
  }
  if (std::strcmp(argv[1], "clean") == 0) {
    clean(argc > 2 ? std::atoi(argv[2]) : 100);
    return 0;
  }
  SimulationOptions options = scene(argv[1]);
  if (argc > 2) options.image_noise_px = std::atof(argv[2]);
  const int blocks = argc > 3 ? std::atoi(argv[3]) : 4;
  std::printf("observations   ideal: B'AB  mean  power   named: alone  with another  another one  none  of\n");
  for (const int points : {700, 1000, 1500, 2500, 3500, 5000}) {
    Count count;
    options.points_per_frame = points;
    for (int seed = 1; seed <= blocks; ++seed) {
      options.seed = static_cast<std::uint64_t>(seed);
      turn_every_tile(tiled(options, options.frames / 4), options.seed, count);
    }
    std::printf("%5lld to %5lld  %11.1f %5.2f  %5.3f  %12d  %12d  %11d  %4d  %2d\n",
                static_cast<long long>(count.least), static_cast<long long>(count.most),
                count.noncentrality / count.cases, count.deviate / count.cases, count.power / count.cases, count.alone,
                count.with_another, count.another, count.nothing, count.cases);
    std::fflush(stdout);
  }
}
