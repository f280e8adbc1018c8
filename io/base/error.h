// Declares the exceptions of the project. A message is one line that lets the user act: it tells the fault, its place
// and the remedy. cluster/ turns the exceptions into exit codes in one place.
#pragma once

#include <stdexcept>
#include <string>

namespace megablock {

// Base of all errors that the program reports to its user.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Wrong usage or wrong input (exit code 2).
class InputError : public Error {
 public:
  using Error::Error;
};

// A file of the job is missing, truncated, altered, or of another version. If it is the result of a unit of work, the
// unit is computed again.
class StoreError : public Error {
 public:
  using Error::Error;
};

// A computation is impossible with these data: a singular tile, too few points. The unit of work has failed.
class ComputeError : public Error {
 public:
  using Error::Error;
};

// The user or the scheduler asked the program to stop (exit code 75).
class Interrupted : public Error {
 public:
  using Error::Error;
};

}  // namespace megablock
