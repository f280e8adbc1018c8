#include "cluster/mpi/communicator.h"

#include <mpi.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <list>
#include <stdexcept>
#include <thread>

#include "cluster/process/signals.h"

namespace megablock {

namespace {

bool started_by_launcher() {
  return std::getenv("OMPI_COMM_WORLD_SIZE") != nullptr || std::getenv("PMIX_RANK") != nullptr ||
         std::getenv("PMI_RANK") != nullptr;
}

// Waits for a request without spinning, because other ranks and our own progress thread need the core.
void wait_politely(MPI_Request& request) {
  int done = 0;
  auto pause = std::chrono::microseconds(20);
  constexpr auto kLongestPause = std::chrono::microseconds(2000);
  for (MPI_Test(&request, &done, MPI_STATUS_IGNORE); !done; MPI_Test(&request, &done, MPI_STATUS_IGNORE)) {
    std::this_thread::sleep_for(pause);
    pause = std::min(pause * 2, kLongestPause);
  }
}

enum Counted : MPI_Aint { kClaimed, kDone, kCounters };

constexpr std::size_t kLargestMessage = std::size_t{1} << 30;  // the counts of MPI 3 are int

}  // namespace

struct Communicator::Mpi {
  MPI_Comm world = MPI_COMM_NULL;
  MPI_Comm progress_world = MPI_COMM_NULL;
  MPI_Win window = MPI_WIN_NULL;
  std::int64_t* counters = nullptr;  // memory of the window on rank 0: a number for each value of Counted
  std::atomic<bool> stop{false};
  std::thread progress;
  struct Sent {
    std::string bytes;
    std::vector<MPI_Request> requests;
  };
  std::list<Sent> sent;  // buffers of sends that are not complete

  // Changes a counter and returns its value before.
  std::int64_t change(Counted which, std::int64_t value, MPI_Op operation) {
    std::int64_t before = 0;
    MPI_Fetch_and_op(&value, &before, MPI_INT64_T, 0, which, operation, window);
    MPI_Win_flush(0, window);
    return before;
  }
};

Communicator::Communicator(int* argc, char*** argv) {
  if (!started_by_launcher()) return;
  // Open MPI chooses this component for windows over TCP, although it refuses MPI_THREAD_MULTIPLE. Other components can
  // be used instead.
  setenv("OMPI_MCA_osc", "^pt2pt", 0);
  int provided = 0;
  MPI_Init_thread(argc, argv, MPI_THREAD_MULTIPLE, &provided);
  if (provided < MPI_THREAD_MULTIPLE) throw std::runtime_error("MPI library lacks MPI_THREAD_MULTIPLE");
  mpi_ = std::make_unique<Mpi>();
  MPI_Comm_dup(MPI_COMM_WORLD, &mpi_->world);
  MPI_Comm_dup(MPI_COMM_WORLD, &mpi_->progress_world);
  MPI_Comm_rank(mpi_->world, &rank_);
  MPI_Comm_size(mpi_->world, &size_);

  MPI_Comm host;
  MPI_Comm_split_type(mpi_->world, MPI_COMM_TYPE_SHARED, rank_, MPI_INFO_NULL, &host);
  MPI_Comm_size(host, &ranks_on_host_);
  MPI_Comm_free(&host);

  const MPI_Aint bytes = rank_ == 0 ? kCounters * sizeof(std::int64_t) : 0;
  MPI_Win_allocate(bytes, sizeof(std::int64_t), MPI_INFO_NULL, mpi_->world, &mpi_->counters, &mpi_->window);
  if (rank_ == 0) std::fill_n(mpi_->counters, kCounters, std::int64_t{0});
  MPI_Win_lock_all(0, mpi_->window);
  barrier();

  // Over TCP the rank of the counter must call the library so that claims of other ranks are served. This thread does
  // so while the main thread computes.
  if (rank_ == 0 && size_ > 1) {
    mpi_->progress = std::thread([this] {
      while (!mpi_->stop) {
        int flag = 0;
        MPI_Iprobe(MPI_ANY_SOURCE, MPI_ANY_TAG, mpi_->progress_world, &flag, MPI_STATUS_IGNORE);
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
    });
  }
}

Communicator::~Communicator() {
  if (!mpi_) return;
  barrier();
  end_of_work();
  mpi_->stop = true;
  if (mpi_->progress.joinable()) mpi_->progress.join();
  MPI_Win_unlock_all(mpi_->window);
  MPI_Win_free(&mpi_->window);
  MPI_Comm_free(&mpi_->progress_world);
  MPI_Comm_free(&mpi_->world);
  MPI_Finalize();
}

void Communicator::barrier() {
  if (!mpi_) return;
  MPI_Request request;
  MPI_Ibarrier(mpi_->world, &request);
  wait_politely(request);
}

std::string Communicator::broadcast(const std::string& bytes, int root) {
  if (!mpi_) return bytes;
  std::uint64_t size = bytes.size();
  MPI_Request request;
  MPI_Ibcast(&size, 1, MPI_UINT64_T, root, mpi_->world, &request);
  wait_politely(request);
  std::string result = rank_ == root ? bytes : std::string(size, '\0');
  for (std::size_t at = 0; at < size; at += kLargestMessage) {
    const int count = static_cast<int>(std::min<std::size_t>(kLargestMessage, size - at));
    MPI_Ibcast(result.data() + at, count, MPI_BYTE, root, mpi_->world, &request);
    wait_politely(request);
  }
  return result;
}

std::vector<std::string> Communicator::gather_all(const std::string& bytes) {
  if (!mpi_) return {bytes};
  std::vector<std::string> all(static_cast<std::size_t>(size_));
  for (int r = 0; r < size_; ++r) all[static_cast<std::size_t>(r)] = broadcast(r == rank_ ? bytes : std::string(), r);
  return all;
}

bool Communicator::any(bool value) {
  if (!mpi_) return value;
  int in = value ? 1 : 0, out = 0;
  MPI_Request request;
  MPI_Iallreduce(&in, &out, 1, MPI_INT, MPI_MAX, mpi_->world, &request);
  wait_politely(request);
  return out != 0;
}

void Communicator::send(int to, int tag, std::string bytes) {
  Mpi::Sent& sent = mpi_->sent.emplace_back(Mpi::Sent{std::move(bytes), {}});
  // A long message is sent in parts. A part shorter than the largest (perhaps empty) is the last one.
  std::size_t count = kLargestMessage;
  for (std::size_t at = 0; count == kLargestMessage; at += count) {
    count = std::min(kLargestMessage, sent.bytes.size() - at);
    MPI_Isend(sent.bytes.data() + at, static_cast<int>(count), MPI_BYTE, to, tag, mpi_->world,
              &sent.requests.emplace_back());
  }
}

std::string Communicator::receive(int from, int tag) {
  std::string bytes;
  int count = static_cast<int>(kLargestMessage);
  while (static_cast<std::size_t>(count) == kLargestMessage) {
    MPI_Message message;
    MPI_Status status;
    int there = 0;
    while (MPI_Improbe(from, tag, mpi_->world, &there, &message, &status), !there)
      std::this_thread::sleep_for(std::chrono::microseconds(100));
    MPI_Get_count(&status, MPI_BYTE, &count);
    const std::size_t at = bytes.size();
    bytes.resize(at + static_cast<std::size_t>(count));
    MPI_Request request;
    MPI_Imrecv(bytes.data() + at, count, MPI_BYTE, &message, &request);
    wait_politely(request);
  }
  return bytes;
}

void Communicator::flush_sends() {
  if (!mpi_) return;
  for (Mpi::Sent& sent : mpi_->sent)
    for (MPI_Request& request : sent.requests) wait_politely(request);
  mpi_->sent.clear();
}

void Communicator::reset_counter() {
  if (!mpi_) {
    local_counter_ = 0;
    local_done_ = 0;
    return;
  }
  barrier();
  if (rank_ == 0) {
    mpi_->change(kClaimed, 0, MPI_REPLACE);
    mpi_->change(kDone, 0, MPI_REPLACE);
  }
  barrier();
}

std::int64_t Communicator::claim() { return mpi_ ? mpi_->change(kClaimed, 1, MPI_SUM) : local_counter_++; }

void Communicator::use_up_counter() {
  const std::int64_t beyond = std::int64_t{1} << 62;
  if (mpi_)
    mpi_->change(kClaimed, beyond, MPI_REPLACE);
  else
    local_counter_ = beyond;
}

void Communicator::add_done(std::int64_t parts) {
  if (mpi_)
    mpi_->change(kDone, parts, MPI_SUM);
  else
    local_done_ += parts;
}

std::int64_t Communicator::done() const {
  if (!mpi_) return local_done_;
  // The counter is read without the window, which the thread of the progress display must not use.
  return rank_ == 0 ? std::atomic_ref<std::int64_t>(mpi_->counters[kDone]).load() : 0;
}

void Communicator::abort(int exit_code) {
  if (mpi_) MPI_Abort(mpi_->world, exit_code);
  std::_Exit(exit_code);
}

}  // namespace megablock
