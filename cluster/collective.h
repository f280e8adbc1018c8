// Work of one rank whose failure is everybody's: the error is thrown on all ranks, so that none waits for ever.
#pragma once

#include <functional>
#include <string>

#include "cluster/communicator.h"

namespace megablock {

// Runs `work` on rank 0 and returns its text on every rank; an error of the project's family is rethrown everywhere.
std::string on_first_rank(Communicator& ranks, const std::function<std::string()>& work);

// Collective: throws on every rank when any rank has an error; the lowest rank's is taken. `kind` is 'i' for InputError,
// 'c' for any other; empty text: none here.
void share_error(Communicator& ranks, char kind, const std::string& text);

}  // namespace megablock
