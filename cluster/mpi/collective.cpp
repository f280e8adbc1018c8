#include "cluster/mpi/collective.h"

#include "io/base/error.h"

namespace megablock {

namespace {

[[noreturn]] void throw_error(char kind, const std::string& text) {
  if (kind == 'i') throw AgreedError<InputError>(text);
  throw AgreedError<Error>(text);
}

}  // namespace

std::string on_first_rank(Communicator& ranks, const std::function<std::string()>& work) {
  std::string message = " ";
  if (ranks.rank() == 0) {
    try {
      message += work();
    } catch (const InputError& error) {
      message = std::string("i") + error.what();
    } catch (const std::exception& error) {
      message = std::string("c") + error.what();
    }
  }
  message = ranks.broadcast(message);
  if (message.front() != ' ') throw_error(message.front(), message.substr(1));
  return message.substr(1);
}

int exit_code_on_first_rank(Communicator& ranks, const std::function<int()>& work) {
  if (ranks.size() == 1) return work();
  return std::stoi(on_first_rank(ranks, [&] { return std::to_string(work()); }));
}

void share_error(Communicator& ranks, char kind, const std::string& text) {
  if (!ranks.any(!text.empty())) return;
  for (const std::string& message : ranks.gather_all(text.empty() ? std::string() : kind + text))
    if (!message.empty()) throw_error(message.front(), message.substr(1));
}

}  // namespace megablock
