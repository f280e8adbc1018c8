// Declares the messages between ranks that the runner of the merge tree needs. It is an interface, because merge/ does
// not know MPI: the communicator of cluster/mpi/communicator.h sends messages between ranks, and OneProcess is for one
// process.
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

  // Collective: every rank makes these calls in the same order. A call returns when this rank has its result.
  virtual std::string broadcast(const std::string& bytes, int root) = 0;      // the root's bytes, on every rank
  virtual std::vector<std::string> gather_all(const std::string& bytes) = 0;  // every rank's bytes, in rank order

  // Point to point. The tag (>= 0) tells the messages between two ranks apart; a tag is used once in a sweep. send()
  // returns at once; flush_sends() returns when all messages of this rank have left.
  virtual void send(int to, int tag, std::string bytes) = 0;
  virtual std::string receive(int from, int tag) = 0;
  virtual void flush_sends() = 0;
};

// A run of one rank, where no message is sent.
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
