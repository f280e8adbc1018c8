// Compares 2x2 registrations (CN-25) at many simulated crossings with the robust start, with the published one, and
// with the 3-D/3-D baseline (CN-24): the share of the feasible registrations that converge to 2 cm and 0.02 degrees.
//
//   compare_registration [crossings = 2000] [seed = 1]
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>

#include "tests/support/adjust/crossing.h"

namespace {

using namespace megablock;

struct Tally {
  int accepted = 0, good = 0, feasible_good = 0;
  double squares = 0;  // of accepted position errors, m^2
  void add(bool accepted_now, bool feasible, const RegistrationErrors& e) {
    if (!accepted_now) return;
    ++accepted;
    good += e.good(), feasible_good += feasible && e.good();
    squares += e.position_m * e.position_m;
  }
  void print(const char* name, int feasible) const {
    std::printf("%-28s accepted %5d, of these within 2 cm and 0.02 deg %5d; of the feasible %.2f %%; rms %.4f m\n",
                name, accepted, good, 100.0 * feasible_good / feasible, std::sqrt(squares / std::max(1, accepted)));
  }
};

std::string without_numbers(const std::string& text) {
  std::string kind;
  for (const char c : text)
    if ((c < '0' || c > '9') && c != '.')
      kind += c;
    else if (kind.empty() || kind.back() != '#')
      kind += '#';
  return kind;
}

}  // namespace

int main(int argc, char** argv) {
  const int crossings = argc > 1 ? std::atoi(argv[1]) : 2000;
  const std::uint64_t seed = argc > 2 ? static_cast<std::uint64_t>(std::atoll(argv[2])) : 1;
  // A place is asked for the pose to two standard deviations of 1 cm and 0.01 degrees, and a tenth for its estimate.
  PairRegistrationOptions asked;
  asked.max_position_sigma_m = 0.011;
  asked.max_rotation_sigma_deg = 0.011;
  Tally robust, published, baseline;
  int feasible = 0, infeasible_refused = 0;
  std::map<std::string, int> refusals;
  for (int i = 0; i < crossings; ++i) {
    Noise noise(seed * 1000003 + static_cast<std::uint64_t>(i));
    CrossingOptions options;
    options.points = static_cast<int>(std::exp(noise.uniform(std::log(4.0), std::log(150.0))));
    const Crossing crossing = make_crossing(seed * 7919 + static_cast<std::uint64_t>(i), options);
    const bool possible = is_feasible(crossing);
    feasible += possible;
    const PairRegistration r = register_pair(crossing.trajectory, crossing.tracks, asked, seed);
    robust.add(r.accepted, possible, errors_of(r.relative, crossing));
    infeasible_refused += !possible && !r.accepted;
    if (!r.accepted) ++refusals[without_numbers(r.reason)];
    PairRegistrationOptions as_published = asked;
    as_published.robust_start = false;
    const PairRegistration p = register_pair(crossing.trajectory, crossing.tracks, as_published, seed);
    published.add(p.accepted, possible, errors_of(p.relative, crossing));
    if (const auto b = register_3d_3d(crossing.trajectory, crossing.tracks, seed))
      baseline.add(true, possible, errors_of(*b, crossing));
  }
  std::printf(
      "%d crossings, 2 m of drift, 30 %% wrong matches, 0.5 px: %d feasible (%.1f %%), of the others %d refused\n",
      crossings, feasible, 100.0 * feasible / crossings, infeasible_refused);
  robust.print("2x2, start by resection", feasible);
  published.print("2x2, published start", feasible);
  baseline.print("3-D/3-D", feasible);
  for (const auto& [reason, count] : refusals) std::printf("refused %5d: %s\n", count, reason.c_str());
}
