// Work inside a tile on several threads: everything is visited once, in an order that trees allow, and errors come out.
#include "merge/plan/tree_workers.h"

#include <gtest/gtest.h>

#include <atomic>
#include <numeric>
#include <set>
#include <stdexcept>

#include "geometry/threads/workers.h"

namespace megablock {
namespace {

// A whole binary tree of so many leaves; children before parents.
std::vector<PlanNode> tree_of(std::int64_t leaves) {
  std::vector<PlanNode> nodes;
  std::vector<std::int64_t> tops;
  for (std::int64_t leaf = 0; leaf < leaves; ++leaf) {
    nodes.emplace_back().leaf = leaf;
    tops.push_back(std::ssize(nodes) - 1);
  }
  while (tops.size() > 1) {
    std::vector<std::int64_t> next;
    for (std::size_t i = 0; i + 1 < tops.size(); i += 2) {
      PlanNode& node = nodes.emplace_back();
      node.left = tops[i], node.right = tops[i + 1];
      next.push_back(std::ssize(nodes) - 1);
      nodes[static_cast<std::size_t>(tops[i])].parent = nodes[static_cast<std::size_t>(tops[i + 1])].parent =
          next.back();
    }
    if (tops.size() % 2 == 1) next.push_back(tops.back());
    tops = std::move(next);
  }
  return nodes;
}

class Workers : public testing::TestWithParam<int> {
 protected:
  void SetUp() override { omp_set_num_threads(GetParam()); }
  void TearDown() override { omp_set_num_threads(before_); }
  const int before_ = omp_get_max_threads();
};

TEST_P(Workers, VisitEverythingOnce) {
  std::vector<int> visits(1000, 0);
  visit_in_parallel(1000, [&](std::int64_t i) { ++visits[static_cast<std::size_t>(i)]; });
  EXPECT_EQ(std::accumulate(visits.begin(), visits.end(), 0), 1000);
  EXPECT_EQ(*std::ranges::min_element(visits), 1);
  visit_in_parallel(0, [](std::int64_t) { FAIL(); });
}

TEST_P(Workers, VisitChildrenFirst) {
  for (const std::int64_t leaves : {1, 2, 7, 64}) {
    const std::vector<PlanNode> nodes = tree_of(leaves);
    std::vector<std::int64_t> below(nodes.size(), 0);  // leaves, 0: not visited
    visit_children_first(nodes, [&](std::int64_t n) {
      const PlanNode& node = nodes[static_cast<std::size_t>(n)];
      ASSERT_EQ(below[static_cast<std::size_t>(n)], 0);
      if (node.leaf < 0) {
        ASSERT_GT(below[static_cast<std::size_t>(node.left)], 0);
        ASSERT_GT(below[static_cast<std::size_t>(node.right)], 0);
      }
      below[static_cast<std::size_t>(n)] =
          node.leaf >= 0 ? 1 : below[static_cast<std::size_t>(node.left)] + below[static_cast<std::size_t>(node.right)];
    });
    EXPECT_EQ(below.back(), leaves);
  }
}

TEST_P(Workers, VisitParentsFirst) {
  for (const std::int64_t leaves : {1, 2, 7, 64}) {
    const std::vector<PlanNode> nodes = tree_of(leaves);
    std::atomic<std::int64_t> visited = 0;
    std::vector<int> depth(nodes.size(), -1);
    visit_parents_first<std::vector<std::int64_t>>(nodes, [&](std::int64_t n, const std::vector<std::int64_t>* parent) {
      std::vector<std::int64_t> path = parent ? *parent : std::vector<std::int64_t>();
      EXPECT_EQ(nodes[static_cast<std::size_t>(n)].parent, parent ? path.back() : -1);
      path.push_back(n);
      depth[static_cast<std::size_t>(n)] = static_cast<int>(path.size());
      ++visited;
      return path;
    });
    EXPECT_EQ(visited, std::ssize(nodes));
    EXPECT_EQ(depth.back(), 1);
  }
}

// The same one whatever the threads, and when all is at rest again.
TEST_P(Workers, ThrowTheFirstError) {
  const std::vector<PlanNode> nodes = tree_of(64);
  const auto said = [](auto&& work) -> std::string {
    try {
      work();
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "nothing";
  };
  const auto fail_at = [](std::int64_t n, std::set<std::int64_t> where) {
    if (where.contains(n)) throw std::runtime_error(std::to_string(n));
  };
  for (int time = 0; time < 20; ++time) {
    EXPECT_EQ(said([&] { visit_in_parallel(100, [&](std::int64_t i) { fail_at(i, {90, 17, 55}); }); }), "17");
    std::atomic<int> visited = 0;
    EXPECT_EQ(said([&] {
                visit_children_first(nodes, [&](std::int64_t n) {
                  fail_at(n, {5, 40});
                  ++visited;
                });
              }),
              "5");
    EXPECT_EQ(visited, 127 - 2 - (6 + 6 - 1));  // the six nodes above each; one, the root, is above both
    EXPECT_EQ(said([&] {
                visit_parents_first<int>(nodes, [&](std::int64_t n, const int*) {
                  fail_at(n, {5, 40});
                  return 0;
                });
              }),
              "5");
  }
}

TEST_P(Workers, HaveSomethingOfTheirOwn) {
  std::atomic<int> made = 0;
  PerThread<std::int64_t> sums([&] {
    ++made;
    return std::make_unique<std::int64_t>(0);
  });
  std::vector<std::int64_t*> seen(1000);
  visit_in_parallel(1000, [&](std::int64_t i) {
    seen[static_cast<std::size_t>(i)] = &sums.mine();
    *seen[static_cast<std::size_t>(i)] += i;
  });
  EXPECT_LE(made, GetParam());
  std::int64_t all = 0;
  for (std::int64_t* sum : std::set<std::int64_t*>(seen.begin(), seen.end())) all += *sum;
  EXPECT_EQ(all, 999 * 1000 / 2);
}

INSTANTIATE_TEST_SUITE_P(Threads, Workers, testing::Values(1, 2, 5));

}  // namespace
}  // namespace megablock
