// Reads project files that a test gives as text, beside a few images with positions.
#pragma once

#include <string>
#include <vector>

#include "io/base/error.h"
#include "io/project/project.h"
#include "io/project/project_sections.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock::fixture {

inline const Tags kDji = {
    {"Exif.Image.Make", "DJI"}, {"Exif.Image.Model", "FC300S"}, {"Exif.Photo.FocalLength", "361/100"}};

// Five images on a line to the east, about 76 m apart, at 46.84 N 91.99 W, 250 m.
inline void write_line(const ScratchDirectory& folder, int count = 5) {
  for (int i = 0; i < count; ++i)
    write_image_file(folder.path("images/" + std::to_string(i) + ".jpg"), 64, 48, i,
                     joined(kDji, gps_tags(46.84, -91.99 + 0.001 * i, 250)));
}

// The sections of a program whose first three need images.
inline const std::vector<SettingsSection> kSections = {
    {"features", "", true}, {"candidates", "", true},  {"matching", "filter_model", true},
    {"tiles", "", false},   {"adjustment", "", false}, {"merge", "", false}};

inline Project read_text(const ScratchDirectory& folder, const std::string& text) {
  write_file(folder.path("block.yaml"), text);
  return read_project(folder.path("block.yaml"), kSections);
}

// The message without the path of the folder.
inline std::string refusal(const ScratchDirectory& folder, const std::string& text) {
  std::string message = message_of<InputError>([&] { read_text(folder, text); });
  for (std::size_t at; (at = message.find(folder.path() + "/")) != std::string::npos;)
    message.erase(at, folder.path().size() + 1);
  return message;
}

}  // namespace megablock::fixture
