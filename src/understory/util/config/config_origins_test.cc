#include "understory/util/config/config_origins.h"

#include <gtest/gtest.h>

#include "understory/util/error.h"

namespace understory {
namespace {

struct Settings {
  double voxel_size_m = 0.5;
  int count = 3;
  bool enabled = true;
  std::vector<double> gains = {1.0, 2.0};
};

ConfigTable settings_table(Settings& sample) {
  ConfigTable table;
  table.section("map", [&] {
    table.add("voxel_size_m", sample.voxel_size_m, {0.05, 10.0}, "m", "edge of a voxel");
    table.add("count", sample.count, {1, 100}, "", "how many");
    table.section("deep", [&] { table.add("gains", sample.gains, "", "gains"); });
  });
  table.add("enabled", sample.enabled, "whether");
  return table;
}

// A value that was set to what it was before counts as set, too.
TEST(ConfigOrigins, RememberWhatSetEachKeyLast) {
  Settings sample;
  const ConfigTable table = settings_table(sample);
  ConfigOrigins origins;
  note_yaml(table, "map: {voxel_size_m: 0.5, deep: {gains: [1, 2]}}\nenabled: true\nother: 1\n",
            "profile x", origins);
  note_settings(table, {"enabled=true", "map.deep.gains=[2, 3]"}, origins);
  EXPECT_EQ(origins, (ConfigOrigins{{"map.voxel_size_m", "profile x"},
                                    {"map.deep.gains", "--set"},
                                    {"enabled", "--set"}}));
}

TEST(ConfigOrigins, ValuesByTheirKeys) {
  Settings sample;
  const ConfigTable table = settings_table(sample);
  set_value(table, "map.count", "7");
  set_value(table, "map.deep.gains", "[3, 0.25]");
  EXPECT_EQ(sample.count, 7);
  EXPECT_EQ(value_of(table, "map.deep.gains"), "[3, 0.25]");
  EXPECT_THROW(set_value(table, "map.count", "1000"), InternalError);
  EXPECT_THROW(static_cast<void>(value_of(table, "map.cuont")), InternalError);
}

TEST(ConfigOrigins, RemarksStandBeforeTheMeaningAndAreReadOver) {
  Settings sample;
  sample.count = 4;
  const std::string text = yaml_with_remarks(
      settings_table(sample), {{"map.count", "more: it rains"}, {"enabled", "as ever"}});
  EXPECT_NE(text.find("# more: it rains. how many (default 4, 1..100)\n"), std::string::npos)
      << text;
  EXPECT_NE(text.find("# as ever. whether (default true, true|false)\n"), std::string::npos)
      << text;
  Settings again;
  settings_table(again).read_yaml(text, "printed");
  EXPECT_EQ(again.count, 4);
}

}  // namespace
}  // namespace understory
