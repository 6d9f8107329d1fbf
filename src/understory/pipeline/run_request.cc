#include "understory/pipeline/run_request.h"

#include "understory/pipeline/source.h"

namespace understory {

std::string RunRequest::found(const std::string& file) const {
  const bool relative = !file.empty() && std::filesystem::path(file).is_relative();
  if (begun_in.empty() || !relative || is_simulation(file)) return file;
  return (begun_in / file).string();
}

std::vector<InputIdentity> RunRequest::identify_inputs() const {
  std::vector<InputIdentity> inputs{identify("the recording", recording)};
  const auto add = [&](const std::string& what, const std::string& file) {
    if (!file.empty()) inputs.push_back(identify(what, file));
  };
  add("the extrinsics", open.extrinsics_file);
  add("the metadata of the capture", open.metadata_file);
  for (const std::string& file : more_inputs)
    add("the file of the configuration", file);
  return inputs;
}

}  // namespace understory
