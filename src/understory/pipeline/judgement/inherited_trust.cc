#include "understory/pipeline/judgement/inherited_trust.h"

#include <algorithm>
#include <optional>
#include <system_error>

#include "understory/pipeline/run_folder/run_json.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

std::optional<RunStatus> status_from_name(const std::string& name) {
  for (const RunStatus status :
       {RunStatus::kComplete, RunStatus::kPartial, RunStatus::kUntrusted}) {
    if (to_string(status) == name) return status;
  }
  return std::nullopt;
}

// "forest" of "runs/forest", "runs/forest/" and "." within it.
std::string name_of(const fs::path& folder) {
  fs::path path = fs::absolute(folder).lexically_normal();
  if (path.filename().empty()) path = path.parent_path();
  return "run " + path.filename().string() + ": ";
}

bool has_to_be_a_run(const fs::path& folder) {
  std::error_code ignored;
  return fs::exists(folder / "trajectory.tum", ignored) &&
         !fs::exists(folder / "site.yaml", ignored);
}

InheritedTrust unknown(const std::string& run, const std::string& why) {
  return {RunStatus::kUntrusted,
          {run + why + ", so it is not known whether its result can be trusted"}};
}

}  // namespace

InheritedTrust trust_of_run(const fs::path& run, bool expected) {
  std::error_code ignored;
  const bool is_folder = fs::is_directory(run, ignored);
  const fs::path folder = is_folder ? run : fs::absolute(run).lexically_normal().parent_path();
  const std::string name = name_of(folder);
  const RunJson json(folder);
  if (!json.is_present()) {
    if (!is_folder || !(expected || has_to_be_a_run(folder))) return {};
    return unknown(name, "it holds no run.json");
  }
  if (!json.is_object()) return unknown(name, "its run.json cannot be read");
  const std::optional<RunStatus> status = status_from_name(json.find_text("/status"));
  if (!status) return unknown(name, "its run.json has no status");
  InheritedTrust trust{*status, {}};
  if (*status == RunStatus::kComplete) return trust;
  for (const std::string& reason : json.find_texts("/reasons"))
    trust.reasons.push_back(name + reason);
  if (trust.reasons.empty()) trust.reasons.push_back(name + "it is " + to_string(*status));
  return trust;
}

void inherit(const InheritedTrust& trust, RunStatus& status, std::vector<std::string>& reasons) {
  status = std::max(status, trust.status);
  std::vector<std::string> all;
  const auto add = [&all](const std::vector<std::string>& some) {
    for (const std::string& reason : some)
      if (std::find(all.begin(), all.end(), reason) == all.end()) all.push_back(reason);
  };
  add(trust.reasons);
  add(reasons);
  reasons = std::move(all);
}

}  // namespace understory
