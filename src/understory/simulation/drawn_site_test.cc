#include "understory/simulation/drawn_site.h"

#include <gtest/gtest.h>

#include <set>

#include "understory/simulation/site.h"

namespace understory {
namespace {

std::string used_keys(SiteConfig site) {
  ConfigTable table;
  describe_used(table, site);
  return table.to_yaml(false);
}

TEST(DrawnSite, EverySeedGivesAValidSiteAndTheSeedsDiffer) {
  std::set<std::string> models;
  std::set<std::string> kinds;
  for (int seed = 1; seed <= 40; ++seed) {
    const SiteConfig site = load_site("random", {"seed=" + std::to_string(seed)});
    EXPECT_FALSE(site.draw);
    EXPECT_TRUE(site.objects.any());
    models.insert(site.lidar.model);
    kinds.insert(site.carrier.kind);
  }
  EXPECT_EQ(models.size(), 4U);
  EXPECT_EQ(kinds.size(), 3U);
  EXPECT_EQ(drawn_settings(7), drawn_settings(7));
  EXPECT_NE(drawn_settings(7), drawn_settings(8));
}

TEST(DrawnSite, SettingsGoOverWhatIsDrawn) {
  const SiteConfig site =
      load_site("random", {"seed=3", "stand.trees_per_ha=123", "lidar.model=RS-16"});
  EXPECT_EQ(site.stand.trees_per_ha, 123.0);
  EXPECT_EQ(site.lidar.model, "RS-16");
}

TEST(DrawnSite, SitesWithoutObjectsAreDescribedAsBefore) {
  const std::string usual = used_keys(load_site("handheld", {}));
  EXPECT_EQ(usual.find("objects"), std::string::npos);
  EXPECT_EQ(usual.find("draw"), std::string::npos);
  EXPECT_EQ(usual.find("truth"), std::string::npos);
  const SiteConfig bare = load_site("handheld", {"objects.clearance_m=3"});
  EXPECT_EQ(site_key(bare), site_key(load_site("handheld", {})));
  EXPECT_NE(site_key(load_site("handheld", {"objects.posts=1"})), site_key(bare));
  EXPECT_NE(used_keys(load_site("handheld", {"objects.posts=1"})).find("posts: 1"),
            std::string::npos);
}

}  // namespace
}  // namespace understory
