#include "io/store/job/events.h"

#include <fcntl.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <tuple>

#include "io/base/error.h"
#include "io/base/file_error.h"

namespace megablock {

double seconds_since_1970() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

namespace {

using Json = nlohmann::json;

// The file of this run and rank: "<job>/events/20261121T070000Z-3.jsonl".
std::string path_for(const JobStore& store, int rank) {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  std::array<char, 32> start{};
  std::strftime(start.data(), start.size(), "%Y%m%dT%H%M%SZ", &utc);
  return store.path("events/" + std::string(start.data()) + "-" + std::to_string(rank) + ".jsonl");
}

// Makes the folder of a path and returns the path, so that a constructor can open the file in its initialiser list.
std::string with_folder(const std::string& path) {
  make_folder(std::filesystem::path(path).parent_path().string());
  return path;
}

Json to_json(const UnitEvent& event) {
  Json json = {{"time", event.time_s},     {"stage", event.stage},
               {"unit", event.unit},       {"rank", event.rank},
               {"seconds", event.seconds}, {"claim_seconds", event.claim_seconds},
               {"bytes", event.bytes},     {"peak_rss_mib", event.peak_rss_mib}};
  if (!event.failure.empty()) json["failure"] = event.failure;
  if (!event.figures.empty()) json["figures"] = event.figures;
  return json;
}

UnitEvent from_json(const Json& json) {
  UnitEvent event;
  event.time_s = json.at("time");
  event.stage = json.at("stage");
  event.unit = json.at("unit");
  event.rank = json.at("rank");
  event.seconds = json.at("seconds");
  event.claim_seconds = json.at("claim_seconds");
  event.bytes = json.at("bytes");
  event.peak_rss_mib = json.at("peak_rss_mib");
  event.failure = json.value("failure", std::string());
  event.figures = json.value("figures", event.figures);
  return event;
}

void read_file(const std::string& path, std::vector<UnitEvent>& events) {
  std::ifstream file(path);
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    // std::getline reaches the end of the file only if the last line has no line break.
    if (file.eof()) return;  // the line has no end: it was cut off
    try {
      events.push_back(from_json(Json::parse(line)));
    } catch (const Json::exception&) {
      // After a power failure, the file system may have zero bytes at the end of the file instead of a line.
      if (file.peek() == std::ifstream::traits_type::eof()) return;
      throw StoreError(path + ":" + std::to_string(number) +
                       ": is not an event; delete the file, nothing depends on it");
    }
  }
}

}  // namespace

EventLog::EventLog(const JobStore& store, int rank)
    : path_(with_folder(path_for(store, rank))), file_(path_, O_WRONLY | O_CREAT | O_APPEND) {
  if (file_.id() < 0) throw_file_error(path_, "created", errno);
}

void EventLog::append(UnitEvent event) {
  event.time_s = seconds_since_1970();
  // File names may contain any bytes; those that are not UTF-8 are replaced.
  const std::string line = to_json(event).dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
  write_fully(file_.id(), path_, line.data(), line.size());
}

std::vector<UnitEvent> read_events(const JobStore& store) {
  std::vector<UnitEvent> events;
  for (const std::string& name : store.list("events"))
    if (name.ends_with(".jsonl")) read_file(store.path(name), events);
  std::stable_sort(events.begin(), events.end(), [](const UnitEvent& a, const UnitEvent& b) {
    return std::tie(a.time_s, a.rank, a.unit) < std::tie(b.time_s, b.rank, b.unit);
  });
  return events;
}

}  // namespace megablock
