// The project's one exception family. The message is one line a user can act on: what is wrong, where, what to do.
// cluster/ turns them into exit codes in one place.
#pragma once

#include <stdexcept>
#include <string>

namespace megablock {

// Base of everything the program reports to its user.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Bad usage or bad input (exit code 2).
class InputError : public Error {
 public:
  using Error::Error;
};

// A file of the job is missing, truncated, altered or of another version (recomputed where it is a unit).
class StoreError : public Error {
 public:
  using Error::Error;
};

// A computation that cannot be completed from these data (a failed unit): singular tile, too few points ...
class ComputeError : public Error {
 public:
  using Error::Error;
};

// The user or the scheduler asked to stop (exit code 75).
class Interrupted : public Error {
 public:
  using Error::Error;
};

}  // namespace megablock
