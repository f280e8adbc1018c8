// Runs work on one rank whose failure ends all ranks: the error is thrown on every rank, so that none waits for ever.
#pragma once

#include <functional>
#include <string>

#include "cluster/mpi/communicator.h"
#include "io/base/error.h"

namespace megablock {

// Marks an error that every rank throws in the same way. Any other error concerns one rank alone. The other ranks would
// wait for this rank for ever, so that such an error ends the run (command_line.cpp).
struct Agreed {
  virtual ~Agreed() = default;
};

template <typename Kind>
class AgreedError : public Kind, public Agreed {
 public:
  using Kind::Kind;
};

// Runs `work` on rank 0 and returns its text on every rank. An error of the project's own classes is thrown again on
// every rank.
std::string on_first_rank(Communicator& ranks, const std::function<std::string()>& work);

// Runs work that does not know of ranks on rank 0, while the others wait. Returns its exit code on every rank.
int exit_code_on_first_rank(Communicator& ranks, const std::function<int()>& work);

// Collective: throws on every rank when any rank has an error. The error of the lowest such rank is taken. `kind` is
// 'i' for InputError, 'c' for any other; an empty text means no error here.
void share_error(Communicator& ranks, char kind, const std::string& text);

}  // namespace megablock
