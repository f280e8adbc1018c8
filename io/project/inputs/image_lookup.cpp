#include "io/project/inputs/image_lookup.h"

#include <algorithm>
#include <iterator>

#include "io/text/text_lines.h"

namespace megablock {

namespace {

std::string name_without_ending(const std::string& name) {
  const std::size_t dot = name.find_last_of('.'), slash = name.find_last_of('/');
  const bool has_ending = dot != std::string::npos && (slash == std::string::npos || dot > slash + 1) && dot > 0;
  return has_ending ? name.substr(0, dot) : name;
}

// The name in the name_form of one of the ways of the head of the header.
std::string name_form(const std::string& name, int way) {
  if (way == 0) return name;
  return way == 1 ? lower_case(name) : name_without_ending(lower_case(name));
}

std::string folder_of_name(const std::string& name) {
  const std::size_t slash = name.find_last_of('/');
  return slash == std::string::npos ? "" : name.substr(0, slash);
}

std::string last_part_of_name(const std::string& name) { return name.substr(name.find_last_of('/') + 1); }

std::string with_slashes(const std::string& written) {
  std::string name = trimmed(written);
  for (char& c : name)
    if (c == '\\') c = '/';
  if (name.starts_with("./")) name.erase(0, 2);
  return name;
}

}  // namespace

ImageLookup::ImageLookup(const Block& block, const std::vector<std::string>& left_out)
    : block_(block), left_out_(left_out) {
  for (ImageIndex i(1); one_folder_ && block.images.contains(i); ++i.value)
    one_folder_ = folder_of_name(block.name_of(i)) == folder_of_name(block.name_of(ImageIndex(0)));
}

const ImageLookup::Names& ImageLookup::names(std::size_t way) const {
  Names& names = names_of_way_[way];
  if (names.made) return names;
  names.made = true;
  const auto enter = [](std::unordered_map<std::string, Found>& map, const std::string& key, const Found& found) {
    const auto [entry, inserted] = map.emplace(key, found);
    if (!inserted) entry->second = {Kind::kAmbiguous, {}};
  };
  const auto add = [&](const std::string& name, const Found& found) {
    const std::string key = name_form(name, static_cast<int>(way));
    enter(names.whole, key, found);
    enter(names.last, last_part_of_name(key), found);
  };
  for (ImageIndex i(0); block_.images.contains(i); ++i.value) add(block_.name_of(i), {Kind::kImage, i});
  for (const std::string& name : left_out_) add(name, {Kind::kLeftOut, {}});
  return names;
}

bool ImageLookup::has(const std::string& name) const { return names(0).whole.contains(name); }

ImageLookup::Found ImageLookup::find(const std::string& written) const {
  const std::string name = with_slashes(written);
  const bool by_last_part = one_folder_ || folder_of_name(name).empty();
  // Without ending: first the name of a list that wrote none ("1.5" for "1.5.jpg"), then that of an image that was
  // converted to another kind of file.
  const std::string keys[] = {name_form(name, 0), name_form(name, 1), name_form(name, 1), name_form(name, 2)};
  for (std::size_t way = 0; way < std::size(keys); ++way) {
    const Names& known = names(std::min<std::size_t>(way, kWays - 1));
    const std::string& key = keys[way];
    for (std::size_t at = 0; at != std::string::npos;) {
      const auto found = known.whole.find(key.substr(at));
      if (found != known.whole.end()) return found->second;
      const std::size_t slash = key.find('/', at);
      at = slash == std::string::npos ? slash : slash + 1;
    }
    if (!by_last_part) continue;
    const auto found = known.last.find(last_part_of_name(key));
    if (found != known.last.end()) return found->second;
  }
  return {};
}

}  // namespace megablock
