// The messages that the runner of the merge tree needs between ranks. merge/ knows no MPI: cluster/mpi/communicator.h
// is the communicator of a run over ranks, OneProcess the trivial case of a single process.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "io/base/error.h"

namespace megablock {

class TreeCommunicator {
 public:
  virtual ~TreeCommunicator() = default;
  virtual int rank() const = 0;  // of this process, 0 ... size() - 1
  virtual int size() const = 0;

  // Collective: every rank calls them in the same order. They return when this rank has what it asked for.
  virtual std::string broadcast(const std::string& bytes, int root) = 0;      // the root's bytes, on every rank
  virtual std::vector<std::string> gather_all(const std::string& bytes) = 0;  // every rank's bytes, in rank order

  // Point to point. Messages between two ranks are told apart by their tag (>= 0); a tag is used once in a sweep.
  // send() returns at once, flush_sends() when all messages of this rank have left.
  virtual void send(int to, int tag, std::string bytes) = 0;
  virtual std::string receive(int from, int tag) = 0;
  virtual void flush_sends() = 0;
};

// One rank: nobody sends anything.
class OneProcess : public TreeCommunicator {
 public:
  int rank() const override { return 0; }
  int size() const override { return 1; }
  std::string broadcast(const std::string& bytes, int) override { return bytes; }
  std::vector<std::string> gather_all(const std::string& bytes) override { return {bytes}; }
  void send(int, int, std::string) override { throw ComputeError("one process sends no messages"); }
  std::string receive(int, int) override { throw ComputeError("one process receives no messages"); }
  void flush_sends() override {}
};

}  // namespace megablock
