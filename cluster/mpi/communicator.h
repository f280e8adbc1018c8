// Connects the ranks of a run. Only this class calls MPI.
//
// Without mpirun there is one rank, and MPI is never initialised. Waiting ranks poll with short sleeps instead of
// spinning, so that ranks that share a core do not hold up each other.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "merge/tree/tree_communicator.h"

namespace megablock {

class Communicator : public TreeCommunicator {
 public:
  // Initialises MPI (MPI_THREAD_MULTIPLE) when the program was started by mpirun or srun.
  Communicator(int* argc, char*** argv);
  ~Communicator() override;
  Communicator(const Communicator&) = delete;
  Communicator& operator=(const Communicator&) = delete;

  int rank() const override { return rank_; }
  int size() const override { return size_; }
  // The number of ranks on the host of this rank, which share its cores.
  int ranks_on_host() const { return ranks_on_host_; }

  void barrier();
  // The bytes of the root, on every rank.
  std::string broadcast(const std::string& bytes, int root = 0) override;
  // The bytes of every rank, in rank order, on every rank.
  std::vector<std::string> gather_all(const std::string& bytes) override;
  // True on every rank when it is true on any rank.
  bool any(bool value);

  // Point to point, for the merge tree (merge/tree/tree_communicator.h).
  void send(int to, int tag, std::string bytes) override;
  std::string receive(int from, int tag) override;
  void flush_sends() override;

  // The shared counter from which units are claimed. reset_counter() is collective.
  void reset_counter();
  std::int64_t claim();   // the next number, from 0; never given twice between resets
  void use_up_counter();  // every later claim gets a number beyond any list
  // The progress of all ranks together, for display; 0 after a reset. One thread of a rank at a time may call it.
  void add_done(std::int64_t parts);
  std::int64_t done() const;  // on rank 0; 0 on other ranks

  // Ends all ranks at once with this exit code. A rank that fails alone must not leave the others waiting.
  [[noreturn]] void abort(int exit_code);

 private:
  struct Mpi;
  std::unique_ptr<Mpi> mpi_;  // null: one rank without MPI
  int rank_ = 0, size_ = 1, ranks_on_host_ = 1;
  std::int64_t local_counter_ = 0;
  std::atomic<std::int64_t> local_done_{0};
};

}  // namespace megablock
