// Tests messages of more than 2^31 bytes between two ranks. MPI counts in int, so they are sent in parts. The test
// needs no such amount of memory (tests/unit/ranges/aliased_memory.h). usage: mpirun -n 2 large_messages
#include <cstdio>
#include <cstdlib>
#include <string>

#include "cluster/mpi/communicator.h"
#include "tests/unit/ranges/aliased_memory.h"

namespace {

using megablock::kAliasPeriod;

char expected(std::size_t offset) { return static_cast<char>((offset % kAliasPeriod) * 2654435761U >> 13); }

std::string message(std::size_t size) {
  std::string bytes(size, '\0');
  for (std::size_t i = 0; i < kAliasPeriod; ++i) bytes[i] = expected(i);  // and so everywhere
  return bytes;
}

// A part in the wrong place would have left its bytes in the wrong place of the period. (The terminating zero of the
// string shows there too.)
bool whole(const std::string& bytes, std::size_t size, const char* what) {
  bool same = bytes.size() == size;
  for (std::size_t i = 0; same && i < kAliasPeriod; ++i) same = bytes[i] == expected(i) || i == size % kAliasPeriod;
  std::printf("%s: %zu of %zu bytes%s\n", what, bytes.size(), size, same ? "" : ", wrong");
  return same;
}

}  // namespace

int main(int argc, char** argv) {
  megablock::Communicator ranks(&argc, &argv);
  if (ranks.size() != 2) {
    std::printf("start it on two ranks\n");
    return 1;
  }
  constexpr std::size_t kGibi = std::size_t{1} << 30;
  constexpr int kTag = 5;
  bool same = true;
  for (const std::size_t size : {2 * kGibi + 7, 2 * kGibi}) {  // the second ends with an empty part
    if (ranks.rank() == 0) ranks.send(1, kTag, message(size));
    if (ranks.rank() == 1) same = whole(ranks.receive(0, kTag), size, "sent") && same;
    ranks.flush_sends();
  }
  const std::size_t size = 2 * kGibi + 7;
  const std::string bytes = ranks.broadcast(ranks.rank() == 1 ? message(size) : std::string(), 1);
  same = whole(bytes, size, "broadcast") && same;
  return ranks.any(!same) ? 1 : 0;
}
