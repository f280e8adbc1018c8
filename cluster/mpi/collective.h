// Work of one rank whose failure ends all ranks: the error is thrown on every rank, so that none waits for ever.
#pragma once

#include <functional>
#include <string>

#include "cluster/mpi/communicator.h"
#include "io/base/error.h"

namespace megablock {

// Marks an error that every rank throws alike. Any other error concerns one rank alone. The others would wait for this
// rank for ever, so that such an error ends the run (command_line.cpp).
struct Agreed {
  virtual ~Agreed() = default;
};

template <typename Kind>
class AgreedError : public Kind, public Agreed {
 public:
  using Kind::Kind;
};

// Runs `work` on rank 0 and returns its text on every rank; an error of the project's family is rethrown everywhere.
std::string on_first_rank(Communicator& ranks, const std::function<std::string()>& work);

// Runs work without ranks on rank 0 while the others wait; returns its exit code on every rank.
int exit_code_on_first_rank(Communicator& ranks, const std::function<int()>& work);

// Collective: throws on every rank when any rank has an error; the lowest rank's is taken. `kind` is 'i' for
// InputError, 'c' for any other; empty text: none here.
void share_error(Communicator& ranks, char kind, const std::string& text);

}  // namespace megablock
