// A fixture for readers of files of positions: writes a text, and reads it, or gives the message that refuses it.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "io/base/error.h"
#include "io/project/positions/position_formats.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock::fixture {

class PositionTexts : public ::testing::Test {
 protected:
  PositionTable read(const std::string& name, const std::string& text, const PositionOptions& options = {}) {
    write_file(folder_.path(name), text);
    return read_position_table(folder_.path(name), options);
  }
  std::string format_of(const std::string& name, const std::string& text) {
    write_file(folder_.path(name), text);
    const PositionFormat* format = recognise_positions(read_position_text(folder_.path(name)));
    return format != nullptr ? format->name : "none";
  }
  // Without the folder of the file.
  std::string refusal(const std::string& name, const std::string& text, const PositionOptions& options = {}) {
    std::string message = message_of<InputError>([&] { read(name, text, options); });
    for (std::size_t at; (at = message.find(folder_.path() + "/")) != std::string::npos;)
      message.erase(at, folder_.path().size() + 1);
    return message;
  }
  ScratchDirectory folder_;
};

}  // namespace megablock::fixture
