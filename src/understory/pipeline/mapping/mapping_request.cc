#include "understory/pipeline/mapping/mapping_request.h"

#include "understory/pipeline/source.h"

namespace understory {

std::string MappingRequest::found(const std::string& file) const {
  if (begun_in.empty() || file.empty()) return file;
  return named_from(begun_in, file);
}

std::vector<InputIdentity> MappingRequest::identify_inputs() const {
  std::vector<InputIdentity> inputs{identify("the recording", recording)};
  const auto add = [&](const std::string& what, const std::string& file) {
    if (!file.empty()) inputs.push_back(identify(what, file));
  };
  add("the extrinsics", open.extrinsics_file);
  add("the metadata of the capture", open.metadata_file);
  for (const std::string& file : files_named_in(config))
    add("the file of the configuration", file);
  return inputs;
}

}  // namespace understory
