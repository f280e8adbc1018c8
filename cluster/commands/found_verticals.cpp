#include "cluster/commands/found_verticals.h"

#include <fmt/core.h>

#include <algorithm>
#include <exception>
#include <fstream>
#include <unordered_map>

#include "io/base/error.h"

namespace megablock {

namespace {

constexpr std::uint64_t kFormat = 1;  // fingerprint of the file

using ByKey = std::unordered_map<std::uint64_t, FoundVertical>;

ByKey read_found(const JobStore& store, const std::string& file) {
  ByKey found;
  std::string damage;
  if (!store.is_current(file, kFormat, damage)) return found;
  const std::uint64_t end = store.seal(file)->length;
  std::ifstream in(store.path(file), std::ios::binary);
  while (static_cast<std::uint64_t>(in.tellg()) < end) {
    std::uint64_t key = 0;
    std::size_t length = 0;
    FoundVertical vertical;
    in >> key >> vertical.found >> vertical.roll >> vertical.segments >> length;
    in.get();
    vertical.row.resize(length);
    in.read(vertical.row.data(), static_cast<std::streamsize>(length));
    if (!in) break;
    found.emplace(key, std::move(vertical));
  }
  return found;
}

}  // namespace

FoundVerticals::FoundVerticals(const JobStore& store, std::string file, std::vector<std::uint64_t> keys)
    : store_(store), file_(std::move(file)), keys_(std::move(keys)), found_(keys_.size()) {
  const ByKey found = read_found(store_, file_);
  for (std::size_t k = 0; k < keys_.size(); ++k)
    if (const auto known = found.find(keys_[k]); known != found.end()) found_[k] = known->second;
}

std::size_t FoundVerticals::count() const {
  return static_cast<std::size_t>(
      std::count_if(found_.begin(), found_.end(), [](const auto& p) { return p.has_value(); }));
}

std::vector<FoundVertical> FoundVerticals::all() const {
  std::vector<FoundVertical> all;
  for (const auto& vertical : found_) all.push_back(vertical.value());
  return all;
}

void FoundVerticals::add(std::size_t image, FoundVertical vertical) {
  found_[image] = std::move(vertical);
  saved_ = false;
}

void FoundVerticals::save_now_and_then() {
  if (!saved_ && times_.due()) times_.run([this] { save(); });
}

void FoundVerticals::save() {
  if (saved_) return;
  std::string text;
  for (std::size_t k = 0; k < keys_.size(); ++k)
    if (const auto& p = found_[k]; p && p->failure.empty())
      text += fmt::format("{} {:d} {:.17g} {} {}\n{}", keys_[k], p->found, p->roll, p->segments, p->row.size(), p->row);
  try {
    store_.write(file_, kFormat, [&](const std::string& path) {
      std::ofstream out(path, std::ios::binary);
      if (!(out << text).flush()) throw StoreError(path + ": cannot be written");
    });
  } catch (const std::exception&) {
    // The table is written to the same disk, and that error says what is wrong.
  }
  saved_ = true;
}

}  // namespace megablock
