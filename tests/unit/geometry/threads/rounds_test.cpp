// Rounds of parts: every part runs once, rounds finish in order and are never more than one ahead, and errors are those
// of the first round that fails.
#include "geometry/threads/rounds.h"

#include <gtest/gtest.h>
#include <omp.h>

#include <atomic>
#include <stdexcept>
#include <vector>

namespace megablock {
namespace {

class RoundsOnThreads : public testing::TestWithParam<int> {
 protected:
  void SetUp() override { omp_set_num_threads(GetParam()); }
  void TearDown() override { omp_set_num_threads(before_); }

 private:
  const int before_ = omp_get_max_threads();
};

TEST_P(RoundsOnThreads, EveryPartOnceAndRoundsFinishedInOrder) {
  constexpr std::int64_t kRounds = 50;
  const auto parts = [](std::int64_t round) { return round % 7; };  // some rounds have no parts
  std::vector<std::vector<std::atomic<int>>> visits;
  for (std::int64_t r = 0; r < kRounds; ++r) visits.emplace_back(static_cast<std::size_t>(parts(r)));
  std::vector<std::int64_t> finished;
  std::atomic<std::int64_t> done = 0;  // number of finished rounds
  std::atomic<int> wrong = 0;
  const auto ahead = [&](std::int64_t round) { return round % 5 != 0; };
  const auto may_be_open = [&](std::int64_t round) { return round == done || (round == done + 1 && ahead(round)); };
  visit_in_rounds({kRounds,
                   [&](std::int64_t r) {
                     wrong += !may_be_open(r);
                     return parts(r);
                   },
                   [&](std::int64_t r, std::int64_t part) {
                     wrong += !may_be_open(r);
                     ++visits[static_cast<std::size_t>(r)][static_cast<std::size_t>(part)];
                   },
                   [&](std::int64_t r) {
                     for (const std::atomic<int>& times : visits[static_cast<std::size_t>(r)]) wrong += times != 1;
                     finished.push_back(r);
                     ++done;
                   },
                   ahead});
  EXPECT_EQ(wrong, 0);
  ASSERT_EQ(std::ssize(finished), kRounds);
  for (std::int64_t r = 0; r < kRounds; ++r) EXPECT_EQ(finished[static_cast<std::size_t>(r)], r);
}

TEST_P(RoundsOnThreads, NoRoundsAreNoWork) {
  visit_in_rounds({0, [](std::int64_t) { return 1; }, [](std::int64_t, std::int64_t) { FAIL(); },
                   [](std::int64_t) { FAIL(); }, [](std::int64_t) { return true; }});
}

TEST_P(RoundsOnThreads, TheFirstRoundThatFailsIsNotFinished) {
  for (int repeat = 0; repeat < 20; ++repeat) {
    std::vector<std::int64_t> finished;
    const auto run = [&] {
      visit_in_rounds({10, [](std::int64_t) { return 4; },
                       [](std::int64_t r, std::int64_t part) {
                         if (r >= 3 && part >= 2) throw std::runtime_error(std::to_string(10 * r + part));
                       },
                       [&](std::int64_t r) { finished.push_back(r); }, [](std::int64_t) { return true; }});
    };
    std::string error;
    try {
      run();
    } catch (const std::runtime_error& e) {
      error = e.what();
    }
    EXPECT_EQ(error, "32");
    EXPECT_EQ(finished, (std::vector<std::int64_t>{0, 1, 2}));
  }
}

TEST_P(RoundsOnThreads, ErrorsOfPreparingAndFinishingEndIt) {
  for (const bool preparing : {true, false}) {
    std::int64_t last = -1;
    EXPECT_THROW(visit_in_rounds({6,
                                  [&](std::int64_t r) -> std::int64_t {
                                    if (preparing && r == 4) throw std::runtime_error("prepare");
                                    return 2;
                                  },
                                  [](std::int64_t, std::int64_t) {},
                                  [&](std::int64_t r) {
                                    if (!preparing && r == 4) throw std::runtime_error("finish");
                                    last = r;
                                  },
                                  [](std::int64_t) { return true; }}),
                 std::runtime_error);
    EXPECT_EQ(last, 3);
  }
}

INSTANTIATE_TEST_SUITE_P(Threads, RoundsOnThreads, testing::Values(1, 2, 4));

}  // namespace
}  // namespace megablock
