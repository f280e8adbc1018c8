#include "merge/gauge.h"

namespace megablock {

GaugeReport judge_gauge(const SubtreeSums& root) {
  GaugeReport report;
  for (const HeldUnknown& held : root.held) (held.ratio == 0 ? report.undetermined : report.defect) += 1;
  if (report.defect > 0)
    report.text = "free: defect " + std::to_string(report.defect) + ", datum held at " + describe(root.held.back().id);
  if (report.undetermined > 0)
    report.text += "; " + std::to_string(report.undetermined) + " parameters without any observation held";
  if (root.held_points > 0)
    report.text += "; " + std::to_string(root.held_points) + " undetermined point coordinates held";
  return report;
}

}  // namespace megablock
