#include "understory/util/config/config.h"

#include <gtest/gtest.h>

#include <map>

#include "understory/util/error.h"

namespace understory {
namespace {

enum class Method { kFast, kExact };

struct Sample {
  double voxel_size_m = 0.5;
  int count = 3;
  bool enabled = true;
  std::string name = "a";
  std::vector<double> gains = {1.0, 2.0};
  Method method = Method::kFast;
};

ConfigTable table_of(Sample& sample) {
  ConfigTable table;
  table.section("map", [&] {
    table.add("voxel_size_m", sample.voxel_size_m, {0.05, 10.0}, "m", "edge of a voxel");
    table.add("count", sample.count, {1, 100}, "", "how many");
    table.section("deep", [&] { table.add("gains", sample.gains, "", "gains"); });
  });
  table.add("enabled", sample.enabled, "whether");
  table.add("name", sample.name, "a name");
  table.add_enum("method", sample.method, {{"fast", Method::kFast}, {"exact", Method::kExact}},
                 "which");
  return table;
}

TEST(Config, ReadsEveryType) {
  Sample sample;
  ConfigTable table = table_of(sample);
  table.read_yaml(
      "map:\n  voxel_size_m: 0.25\n  count: 7\n  deep: {gains: [3, 4.5]}\n"
      "enabled: false\nname: b c\nmethod: exact\n",
      "x.yaml");
  EXPECT_EQ(sample.voxel_size_m, 0.25);
  EXPECT_EQ(sample.count, 7);
  EXPECT_EQ(sample.gains, (std::vector<double>{3.0, 4.5}));
  EXPECT_FALSE(sample.enabled);
  EXPECT_EQ(sample.name, "b c");
  EXPECT_EQ(sample.method, Method::kExact);
}

TEST(Config, ReportsAllProblemsAtOnceWithTheirLines) {
  Sample sample;
  ConfigTable table = table_of(sample);
  try {
    table.read_yaml("map:\n  voxel_sise_m: 1\n  count: 1.5\nenabled: maybe\nmethod: slow\n",
                    "x.yaml");
    FAIL() << "expected a ConfigError";
  } catch (const ConfigError& error) {
    ASSERT_EQ(error.problems().size(), 4U);
    EXPECT_EQ(error.problems()[0],
              "x.yaml:2: map.voxel_sise_m: unknown key (did you mean map.voxel_size_m?)");
    EXPECT_EQ(error.problems()[1], "x.yaml:3: map.count: is \"1.5\", expected a whole number");
    EXPECT_NE(error.problems()[2].find("x.yaml:4: enabled"), std::string::npos);
    EXPECT_NE(error.problems()[3].find("expected fast|exact"), std::string::npos);
  }
}

// `inventory` calls it count, and `map` keeps it in a section.
TEST(Config, ProposesTheKeyOfAnotherSection) {
  Sample sample;
  ConfigTable table = table_of(sample);
  const std::map<std::string, std::string> meant_by = {{"voxel_size_m", "map.voxel_size_m"},
                                                       {"inventory.stand.map.count", "map.count"}};
  for (const auto& [given, meant] : meant_by) {
    try {
      table.set({given + "=1"});
      FAIL() << given;
    } catch (const ConfigError& error) {
      EXPECT_EQ(error.what(), "--set " + given + ": unknown key (did you mean " + meant + "?)");
    }
  }
}

// A shipped profile serves several tables.
TEST(Config, PassesOverUnknownKeysOnRequest) {
  Sample sample;
  ConfigTable table = table_of(sample);
  std::vector<std::string> passed_over;
  table.read_yaml("map:\n  colour: red\n  count: 7\nother: {depth_m: 1}\n", "x.yaml", &passed_over);
  EXPECT_EQ(passed_over, (std::vector<std::string>{"map.colour", "other.depth_m"}));
  EXPECT_EQ(sample.count, 7);
  EXPECT_THROW(table.read_yaml("map:\n  count: none\n", "x.yaml", &passed_over), ConfigError);
}

TEST(Config, RefusesValuesOutOfRange) {
  Sample sample;
  ConfigTable table = table_of(sample);
  EXPECT_THROW(table.set({"map.voxel_size_m=0.01"}), ConfigError);
  EXPECT_THROW(table.set({"map.voxel_size_m=nan"}), ConfigError);
  EXPECT_THROW(table.set({"map.count"}), ConfigError);
  EXPECT_EQ(sample.voxel_size_m, 0.5);
  table.set({"map.voxel_size_m=0.05", "map.deep.gains=[9]"});
  EXPECT_EQ(sample.voxel_size_m, 0.05);
  EXPECT_EQ(sample.gains, std::vector<double>{9.0});
}

TEST(Config, WhatItPrintsItReads) {
  Sample sample;
  sample.voxel_size_m = 0.125;
  sample.name = "quote \" and : colon";
  ConfigTable table = table_of(sample);
  const std::string yaml = table.to_yaml(true);
  EXPECT_NE(yaml.find("edge of a voxel (default 0.125, m, 0.05..10)"), std::string::npos) << yaml;
  Sample other;
  ConfigTable other_table = table_of(other);
  other_table.read_yaml(yaml, "printed");
  EXPECT_EQ(other.voxel_size_m, 0.125);
  EXPECT_EQ(other.name, sample.name);
  EXPECT_EQ(other_table.to_yaml(false), table.to_yaml(false));
}

TEST(Config, ProblemsOfSeveralReadingsAreToldAtOnce) {
  Sample sample;
  ConfigTable table = table_of(sample);
  ConfigProblems problems;
  problems.gather([&] { table.read_yaml("map:\n  unheard_of: 1\n", "a.yaml"); });
  problems.gather([&] { table.set({"map.voxel_size_m=0.05"}); });
  problems.gather([&] { table.set({"map.voxel_size_m=-1"}); });
  EXPECT_EQ(sample.voxel_size_m, 0.05);
  try {
    problems.throw_if_any();
    FAIL() << "expected a ConfigError";
  } catch (const ConfigError& error) {
    ASSERT_EQ(error.problems().size(), 2U);
    EXPECT_EQ(error.problems()[0].rfind("a.yaml:2:", 0), 0U) << error.problems()[0];
  }
  EXPECT_NO_THROW(ConfigProblems().throw_if_any());
  EXPECT_THROW(problems.gather([] { throw InputError("f", "", "expected a file"); }), InputError);
}

TEST(Config, BrokenYamlNamesTheLine) {
  Sample sample;
  ConfigTable table = table_of(sample);
  try {
    table.read_yaml("map:\n  count: [1\n", "x.yaml");
    FAIL() << "expected a ConfigError";
  } catch (const ConfigError& error) {
    EXPECT_EQ(std::string(error.what()).rfind("x.yaml:", 0), 0U) << error.what();
  }
}

}  // namespace
}  // namespace understory
