// Names positions that form two groups, as those of two flights or receivers with different heights.
//
// The residuals of the positions of one datum scatter about zero along every axis. Those of two data form two heaps.
// The cut between them is the one that leaves the least squares within the two sides (N. Otsu, "A threshold selection
// method from gray-level histograms", IEEE Trans. SMC 9(1), 1979). Each side of a cut has its mean m and its standard
// deviation s. The sides are two groups when both have at least four positions, when
//
//     m_2 - m_1 > 6 (1 + 6 / n) max(s_1, s_2)   and   m_2 - m_1 > 3 times the median stated sigma,
//
// of the n positions, and when at least half of this distance is empty. The deviations of few are small by chance. One
// heap does not pass: cut in the middle, its sides lie 2.6 s apart where errors are normal, and 3.5 s where they are
// uniform.
#pragma once

#include <span>
#include <string>

#include "io/evaluation/figures.h"
#include "io/result/result.h"

namespace megablock {

// "9 of 18 positions lie 29.8 m above the other 9: DJI_0019.JPG, ...". Empty if the positions form one group.
std::string position_groups_text(const BlockResult& result, std::span<const report::PositionResidual> residuals);

}  // namespace megablock
