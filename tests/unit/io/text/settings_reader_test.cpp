#include "io/text/settings_reader.h"

#include <gmock/gmock.h>

#include "io/base/error.h"
#include "io/text/stage_settings.h"

namespace megablock {
namespace {

using ::testing::HasSubstr;

StageSettings settings_with(const std::string& key, const std::string& value) {
  return {{{"adjustment", key, value, "block.yaml:7"}, {"features", "max_features", "100", "block.yaml:3"}}};
}

std::string input_message_of(const auto& action) {
  try {
    action();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(SettingsReader, AppliesEachKind) {
  StageSettings settings{{{"a", "x", "2.5e-1", "f:1"},
                          {"a", "n", "12", "f:2"},
                          {"a", "on", "true", "f:3"},
                          {"a", "name", "some words", "f:4"},
                          {"a", "loss", "huber", "f:5"}}};
  double x = 1, untouched = 7;
  int n = 0, loss = -1;
  bool on = false;
  std::string name;
  SettingsReader reader(settings, "a");
  EXPECT_TRUE(reader.number("x", x));
  EXPECT_TRUE(reader.integer("n", n));
  EXPECT_TRUE(reader.flag("on", on));
  EXPECT_TRUE(reader.text("name", name));
  EXPECT_TRUE(reader.choice("loss", {"none", "huber"}, loss));
  EXPECT_FALSE(reader.number("absent", untouched));
  EXPECT_NO_THROW(reader.finish());
  EXPECT_EQ(x, 0.25);
  EXPECT_EQ(n, 12);
  EXPECT_TRUE(on);
  EXPECT_EQ(name, "some words");
  EXPECT_EQ(loss, 1);
  EXPECT_EQ(untouched, 7);
}

TEST(SettingsReader, RefusesUnknownKeysWithLineAndKnownKeys) {
  const StageSettings settings = settings_with("max_resdual_px", "3");
  const std::string message = input_message_of([&] {
    double value = 0;
    SettingsReader reader(settings, "adjustment");
    reader.number("max_residual_px", value);
    reader.number("min_intersection_deg", value);
    reader.finish();
  });
  EXPECT_EQ(message,
            "block.yaml:7: unknown key 'max_resdual_px' in 'adjustment'; did you mean 'max_residual_px'? known keys: "
            "max_residual_px, min_intersection_deg");
}

TEST(SettingsReader, RefusesUnitsAndWrongKinds) {
  double number = 0;
  int integer = 0;
  bool flag = false;
  const auto number_message = [&](const std::string& value) {
    const StageSettings settings = settings_with("d", value);
    return input_message_of([&] { SettingsReader(settings, "adjustment").number("d", number); });
  };
  EXPECT_THAT(number_message("3 px"), HasSubstr("block.yaml:7: adjustment.d: '3 px' has text after the number"));
  EXPECT_THAT(number_message("three"), HasSubstr("'three' is not a number"));
  EXPECT_THAT(number_message(""), HasSubstr("not a number"));
  EXPECT_THAT(number_message("nan"), HasSubstr("not a finite number"));
  EXPECT_THAT(number_message("1e999"), HasSubstr("not a"));
  EXPECT_EQ(number_message("+1.5"), "");
  EXPECT_EQ(number, 1.5);
  for (const std::string value : {"1.5", "x", "99999999999", "99999999999999999999999"}) {
    const StageSettings settings = settings_with("n", value);
    EXPECT_THAT(input_message_of([&] { SettingsReader(settings, "adjustment").integer("n", integer); }),
                HasSubstr("block.yaml:7: adjustment.n"))
        << value;
  }
  const StageSettings settings = settings_with("on", "yes");
  EXPECT_THAT(input_message_of([&] { SettingsReader(settings, "adjustment").flag("on", flag); }),
              HasSubstr("'yes' is neither true nor false"));
  int choice = 0;
  EXPECT_THAT(input_message_of([&] {
                SettingsReader(settings, "adjustment").choice("on", {"a", "b"}, choice);
              }),
              HasSubstr("'yes' is not one of: a, b"));
}

}  // namespace
}  // namespace megablock
