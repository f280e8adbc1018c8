#include "cluster/stages/pipeline/false_pairs.h"

#include <fmt/core.h>

#include <algorithm>

#include "cluster/job/messages.h"
#include "cluster/job/work_queue.h"
#include "cluster/stages/common/units.h"
#include "cluster/stages/pipeline/features.h"
#include "io/base/hash.h"
#include "io/store/units/graph_files.h"
#include "match/verification/false_pairs.h"

namespace megablock {

namespace {

struct CellOfMatches {
  std::string name;
  std::size_t first = 0;  // of its pairs among those of all cells
  std::size_t count = 0;
};

// Which pairs of all cells are false. Every rank decides alike.
FalsePairs judge_pairs(const Job& job, const std::vector<VerifiedPair>& pairs) {
  return find_false_pairs(evidence_of_pairs(pairs, read_keypoints(job), job.options.threads));
}

// "a.jpg and b.jpg, ...": those with most matches, which did most harm.
std::string examples(const Block& block, const std::vector<VerifiedPair>& pairs, const FalsePairs& judged) {
  constexpr std::size_t kNamed = 3;
  std::vector<std::size_t> order;
  for (std::size_t p = 0; p < pairs.size(); ++p)
    if (judged.is_false[p]) order.push_back(p);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t p, std::size_t q) { return pairs[p].feature_a.size() > pairs[q].feature_a.size(); });
  std::string text;
  for (std::size_t i = 0; i < std::min(kNamed, order.size()); ++i)
    text += fmt::format("{}{} and {} ({} matches)", i > 0 ? ", " : "", block.name_of(pairs[order[i]].a),
                        block.name_of(pairs[order[i]].b), pairs[order[i]].feature_a.size());
  return text;
}

}  // namespace

bool lacks_positions(const Block& block) {
  const auto placed = std::count_if(block.frames.begin(), block.frames.end(), [](const Frame& frame) {
    return frame.given_pose.has_value() || frame.position_prior.has_value();
  });
  return 2 * placed < std::ssize(block.frames);
}

std::vector<std::string> run_false_pairs(const Stage& stage, const Job& job, JobRecord& record,
                                         const std::vector<std::string>& matches) {
  std::vector<VerifiedPair> pairs;
  std::vector<CellOfMatches> cells;
  FalsePairs judged;
  if (std::ssize(job.block.images) <= kMostJudgedImages && lacks_positions(job.block)) {
    for (const std::string& name : matches) {
      std::vector<VerifiedPair> cell = read_matches(job.store.verified_path(name));
      cells.push_back({name, pairs.size(), cell.size()});
      std::move(cell.begin(), cell.end(), std::back_inserter(pairs));
    }
    judged = judge_pairs(job, pairs);
  }
  std::vector<Unit> units;
  std::vector<std::string> names = matches;
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const CellOfMatches& cell = cells[c];
    const auto first = judged.is_false.begin() + static_cast<std::ptrdiff_t>(cell.first);
    const auto last = first + static_cast<std::ptrdiff_t>(cell.count);
    if (std::find(first, last, 1) == last) continue;
    Hasher hasher;
    hasher.add(stage.algorithm).add(job.store.seal(cell.name)->content_hash);
    for (auto is_false = first; is_false != last; ++is_false) hasher.add(*is_false);
    Unit unit;
    unit.name = unit_name(stage.folder(), static_cast<std::int64_t>(c));
    unit.fingerprint = hasher.value();
    unit.write = [&pairs, &judged, cell](const std::string& path) {
      std::vector<VerifiedPair> good;
      for (std::size_t p = cell.first; p < cell.first + cell.count; ++p)
        if (!judged.is_false[p]) good.push_back(pairs[p]);
      write_matches(path, good);
    };
    names[c] = unit.name;
    units.push_back(std::move(unit));
  }
  if (units.empty()) {
    if (job.is_first_rank()) remove_record(job.store, stage.name);  // an earlier run may have needed the stage
    return matches;
  }
  run_stage(job, record, stage, units);
  for (std::size_t c = 0; c < names.size(); ++c)
    if (!job.store.seal(names[c])) names[c] = matches[c];  // failed, and recorded so
  add_note(
      job, record, stage.name,
      fmt::format("{} of {} pairs of images are left out, because their rotations contradict those of pairs that have "
                  "more in common: {}; such images may look alike and show different things, as two sides of one "
                  "building; the block may be torn between them: look at their places in the report, and add images "
                  "that show two sides at once, or positions",
                  judged.count(), pairs.size(), examples(job.block, pairs, judged)));
  return names;
}

}  // namespace megablock
