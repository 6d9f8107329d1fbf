// What every method of matchers.h owes to those who use it through the seam.
#include "understory/registration/matchers.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <set>

#include "understory/registration/test_stand.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using testing::thin;
using testing::upright;

Vector6d step(double rotation_rad, double translation_m) {
  Vector6d tangent;
  tangent << rotation_rad, -rotation_rad, rotation_rad, translation_m, -translation_m,
      0.5 * translation_m;
  return tangent;
}

class AnyMatcher : public ::testing::TestWithParam<std::string> {
 protected:
  AnyMatcher() {
    config_.method = GetParam();
    pattern_ = testing::os0_128();
    pattern_.rings = 64;
    pattern_.columns = 512;
    stand_ = testing::make_stand({.half_width_m = 20.0, .crowns = false}, 3);
    stand_.bump_m = 0.3;
    source_ = thin(scan(truth_, 99), 0.2F);
  }

  [[nodiscard]] Points scan(const Pose& world_from_sensor, std::uint64_t seed) const {
    return testing::scan_stand(stand_, world_from_sensor, pattern_, seed);
  }
  // Five keyframes along a path of two metres.
  void insert_path(TargetBuilder& builder) const {
    for (int i = 0; i < 5; ++i) {
      const Pose pose = upright(0.5 * i, 0.1 * i, 1.6, 0.03 * i);
      builder.insert(scan(pose, static_cast<std::uint64_t>(i)), pose, std::nullopt);
    }
  }
  [[nodiscard]] MatchTargetPtr path_target() const {
    const auto builder = make_matcher(config_)->make_builder({});
    insert_path(*builder);
    return builder->snapshot();
  }
  void expect_truth(const RegistrationResult& result) const {
    EXPECT_TRUE(result.usable()) << result.reason;
    const Vector6d off = right_difference(result.target_from_source, truth_);
    EXPECT_LT(off.tail<3>().norm(), 0.03);
    EXPECT_LT(off.head<3>().norm(), 0.003);
    EXPECT_GT(result.inlier_ratio, 0.3);  // NDT: cells with few points have no distribution
    EXPECT_GT(result.fitness_m2, 0.0);
    EXPECT_EQ(result.degenerate_directions.cols(), 0);
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix6d>(result.information).eigenvalues()[0], 0.0);
  }

  MatcherConfig config_;
  testing::Stand stand_;
  testing::Pattern pattern_;
  Pose truth_ = upright(1.3, 0.2, 1.65, 0.05);
  Points source_;
};

TEST_P(AnyMatcher, FindsAScanInAMapOfKeyframesFromNearAndFromFar) {
  const MatchTargetPtr target = path_target();
  ASSERT_GT(target->reach_m(), 0.0);
  expect_truth(
      target->match(source_, truth_ * Pose::exp(step(0.005, 0.05)), {}, MatchStart::kNear));
  // Three metres off, where NDT's finest cells alone do not lead back.
  expect_truth(target->match(source_, truth_ * Pose::exp(step(0.05, 2.0)), {}, MatchStart::kFar));
}

// P4 (36): a scan of which half is nowhere in the map is past tau, and tau is below the reach.
TEST_P(AnyMatcher, TellsAtWhichFitnessItsErrorsGrow) {
  const FitnessNoise noise = fitness_noise(config_);
  const MatchTargetPtr target = path_target();
  EXPECT_GT(noise.scale, 0.0);
  EXPECT_GT(noise.threshold_m2, 0.0);
  EXPECT_LT(noise.threshold_m2, 0.3 * target->reach_m() * target->reach_m());
  Points half_lost = source_;
  for (std::size_t i = 0; i < half_lost.size(); i += 2)
    half_lost[i].z() += 50.0F;
  const auto overall = [&](const Points& source) {
    return overall_fitness_m2(target->match(source, truth_, {}, MatchStart::kNear),
                              target->reach_m());
  };
  EXPECT_GT(overall(half_lost), 1.5 * noise.threshold_m2);
  EXPECT_LT(overall(source_), 0.8 * overall(half_lost));
}

TEST_P(AnyMatcher, FindsAScanInASingleCloud) {
  const auto matcher = make_matcher(config_);
  const Pose pose = upright(1.0, 0.0, 1.6);
  const Points cloud = scan(pose, 5);
  const auto target = matcher->make_target(matcher->sums_up_points() ? cloud : thin(cloud, 0.2F));
  RegistrationResult result = target->match(
      source_, pose.inverse() * truth_ * Pose::exp(step(0.005, 0.05)), {}, MatchStart::kFar);
  result.target_from_source = pose * result.target_from_source;
  expect_truth(result);
}

TEST_P(AnyMatcher, GivesTheSameBitsForAnyNumberOfThreads) {
  RegistrationResult results[2];
  for (int i = 0; i < 2; ++i) {
    with_threads(i + 1, [&] {
      results[i] =
          path_target()->match(source_, truth_ * Pose::exp(step(0.01, 0.1)), {}, MatchStart::kFar);
    });
  }
  EXPECT_EQ(results[0].target_from_source.matrix(), results[1].target_from_source.matrix());
  EXPECT_EQ(results[0].information, results[1].information);
}

TEST_P(AnyMatcher, ATargetStaysWhatItIsWhileItsBuilderGoesOn) {
  const auto builder = make_matcher(config_)->make_builder({});
  insert_path(*builder);
  const MatchTargetPtr target = builder->snapshot();
  const Pose guess = truth_ * Pose::exp(step(0.005, 0.05));
  const auto found = [&] {
    return target->match(source_, guess, {}, MatchStart::kNear).target_from_source.matrix();
  };
  const Eigen::Matrix4d before = found();
  const Pose wrong = upright(0.3, -0.3, 1.8, 0.3);
  builder->insert(scan(upright(0.0, 0.0, 1.6), 50), wrong, 15.0);
  const MatchTargetPtr next = builder->snapshot();
  EXPECT_EQ(found(), before);
  EXPECT_NE(next->match(source_, guess, {}, MatchStart::kNear).target_from_source.matrix(), before);
}

// Whether the last target's memory is written on or copied makes no difference.
TEST_P(AnyMatcher, SnapshotsDoNotDependOnWhoHoldsTheLastOne) {
  const Pose guess = truth_ * Pose::exp(step(0.005, 0.05));
  std::vector<Eigen::Matrix4d> found;
  for (const bool hold : {false, true}) {
    const auto builder = make_matcher(config_)->make_builder({});
    MatchTargetPtr target;
    for (int i = 0; i < 5; ++i) {
      const Pose pose = upright(0.5 * i, 0.1 * i, 1.6, 0.03 * i);
      if (!hold) target.reset();
      builder->insert(scan(pose, static_cast<std::uint64_t>(i)), pose, 18.0);
      if (!hold) target.reset();
      target = builder->snapshot();
    }
    found.push_back(
        target->match(source_, guess, {}, MatchStart::kNear).target_from_source.matrix());
  }
  EXPECT_EQ(found[0], found[1]);
}

TEST_P(AnyMatcher, ForgetsWhatIsFar) {
  const auto builder = make_matcher(config_)->make_builder({});
  EXPECT_EQ(builder->snapshot()->size(), 0U);
  insert_path(*builder);
  const std::size_t along_path = builder->snapshot()->size();
  const Pose far = upright(500.0, 0.0, 1.6);
  builder->insert(scan(upright(0.0, 0.0, 1.6), 7), far, 100.0);
  const MatchTargetPtr target = builder->snapshot();
  EXPECT_GT(target->size(), 0U);
  EXPECT_LT(target->size(), along_path);
  const RegistrationResult here = target->match(source_, truth_, {}, MatchStart::kNear);
  EXPECT_EQ(here.status, RegistrationStatus::kTooFewMatches) << here.reason;
  EXPECT_EQ(here.target_from_source.matrix(), truth_.matrix());
  EXPECT_TRUE(target->match(thin(scan(upright(0.0, 0.0, 1.6), 8), 0.2F), far, {}, MatchStart::kNear)
                  .usable());
}

TEST_P(AnyMatcher, SaysWhatItTakesAndForgetsAroundAPlace) {
  const auto builder = make_matcher(config_)->make_builder({});
  const double empty = builder->bytes();
  insert_path(*builder);
  const std::size_t cells = builder->snapshot()->size();
  const double along_path = builder->bytes();
  EXPECT_GT(along_path, empty + 100.0 * static_cast<double>(cells));
  builder->forget_beyond({1.0, 0.2, 1.6}, 4.0);
  const std::size_t left = builder->snapshot()->size();
  EXPECT_GT(left, 0U);
  EXPECT_LT(left, cells / 2);
  EXPECT_LT(builder->bytes(), empty + 0.7 * (along_path - empty));
  builder->clear();
  EXPECT_NEAR(builder->bytes(), empty, 1.0);
}

TEST_P(AnyMatcher, SaysThatAnEmptyTargetAndAFewPointsAreTooLittle) {
  const auto builder = make_matcher(config_)->make_builder({});
  const auto status = [&](const Points& source) {
    const auto result = builder->snapshot()->match(source, truth_, {}, MatchStart::kFar);
    EXPECT_EQ(result.target_from_source.matrix(), truth_.matrix());
    EXPECT_FALSE(result.reason.empty());
    return result.status;
  };
  EXPECT_EQ(status(source_), RegistrationStatus::kTooFewPoints);
  insert_path(*builder);
  EXPECT_EQ(status(Points(5)), RegistrationStatus::kTooFewPoints);
  builder->clear();
  EXPECT_EQ(status(source_), RegistrationStatus::kTooFewPoints);
}

// Flat ground leaves place and heading open: what the terms say of them is taken.
TEST_P(AnyMatcher, TermsHoldWhatTheMatchLeavesOpen) {
  stand_ = testing::Stand();
  const Pose pose = upright(0.0, 0.0, 1.6);
  const auto builder = make_matcher(config_)->make_builder({});
  builder->insert(scan(pose, 1), pose, std::nullopt);
  const MatchTargetPtr target = builder->snapshot();
  const Points source = thin(scan(pose, 2), 0.2F);
  const Pose guess = upright(0.1, 0.05, 1.62);
  const Eigen::Vector3d lever(0.5, 0.0, 0.4);
  const PositionPrior fix{{0.8, -0.2, 2.0}, lever, 1e4 * Eigen::Matrix3d::Identity()};
  const PosePrior heading{guess,
                          (Vector6d() << 0.0, 0.0, 1e4, 0.0, 0.0, 0.0).finished().asDiagonal()};
  const RegistrationResult held = target->match(source, guess, {fix, heading}, MatchStart::kNear);
  ASSERT_TRUE(held.usable()) << held.reason;
  const Eigen::Vector3d off = held.target_from_source * lever - fix.position_in_target;
  EXPECT_LT(off.head<2>().norm(), 0.02);
  EXPECT_NEAR(held.target_from_source.translation().z(), 1.6, 0.03);
  EXPECT_GT(held.degenerate_directions.cols(), 0);  // the points alone still leave it open
}

// For those who minimise it themselves: positive curvature, and a gradient that leads downhill.
TEST_P(AnyMatcher, ItsCostLeadsBackToTheMatch) {
  const MatchTargetPtr target = path_target();
  for (const MatchStart start : {MatchStart::kNear, MatchStart::kFar}) {
    const auto cost = target->cost(source_, start);
    ASSERT_NE(cost, nullptr) << "every method of the list has one";
    EXPECT_GT(cost->step_translation_m(), 0.0);
    EXPECT_GT(cost->step_rotation_rad(), 0.0);
    const PoseCost best = cost->at(truth_);
    for (const double aside : {-0.06, 0.06}) {
      const Vector6d away = step(0.0, aside);
      const PoseCost at = cost->at(truth_ * Pose::exp(away));
      EXPECT_GT(at.cost, best.cost);
      EXPECT_GT(at.gradient.dot(away), 0.0);
      EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix6d>(at.hessian).eigenvalues()[0], 0.0);
    }
  }
}

// Methods that match points; those with features are tested in loam/loam_test.cc.
std::vector<std::string> point_methods() {
  std::vector<std::string> names = matcher_names();
  std::erase_if(names, [](const std::string& name) {
    return make_matcher(MatcherConfig(), name)->feature_finder() != nullptr;
  });
  return names;
}

INSTANTIATE_TEST_SUITE_P(Registry, AnyMatcher, ::testing::ValuesIn(point_methods()),
                         [](const auto& tested) { return tested.param; });

TEST(Matchers, AnUnknownMethodAndImpossibleSettingsAreConfigErrors) {
  MatcherConfig config;
  EXPECT_THROW(static_cast<void>(make_matcher(config, "magic")), ConfigError);
  config.get<NdtMatcherConfig>().cell_sizes_m.clear();
  EXPECT_THROW(static_cast<void>(make_matcher(config)), ConfigError);
  config.get<NdtMatcherConfig>().cell_sizes_m = {30.0};
  EXPECT_THROW(static_cast<void>(make_matcher(config)), ConfigError);
}

TEST(Matchers, EachHasItsSectionAndTheMethodIsOneOfThem) {
  MatcherConfig config;
  ConfigTable table;
  table.section("registration", [&] { describe(table, config); });
  std::set<std::string> sections;
  for (const ConfigTable::Field& field : table.fields()) {
    const std::string below = field.key.substr(std::string("registration.").size());
    if (below != "method") sections.insert(below.substr(0, below.find('.')));
  }
  const std::vector<std::string> names = matcher_names();
  EXPECT_EQ(sections, std::set<std::string>(names.begin(), names.end()));
  table.set({"registration.method=" + names.back()});
  EXPECT_EQ(config.method, names.back());
  EXPECT_THROW(table.set({"registration.method=magic"}), ConfigError);
}

TEST(Matchers, NdtSuitsSparseScansAndScansAlone) {
  const MatcherConfig config;
  EXPECT_TRUE(suited_settings(config, {}).empty());
  const auto sparse = suited_settings(config, {.sparse = true, .alone = false});
  ASSERT_EQ(sparse.size(), 4U);
  EXPECT_EQ(sparse[0].key, "ndt.min_points");
  EXPECT_EQ(sparse[3].key, "ndt.sparse_cell_m");
  EXPECT_EQ(sparse[3].value, "1");
  const auto alone = suited_settings(config, {.sparse = false, .alone = true});
  ASSERT_EQ(alone.size(), 1U);
  EXPECT_EQ(alone[0].value, "[2, 1, 0.5]");
}

}  // namespace
}  // namespace understory
