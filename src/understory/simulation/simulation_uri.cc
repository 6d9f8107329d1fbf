#include "understory/simulation/simulation_uri.h"

#include <cstddef>

namespace understory {

bool is_simulation_uri(const std::string& text) {
  return text.rfind("sim:", 0) == 0;
}

SimulationUri parse_simulation_uri(const std::string& text) {
  if (!is_simulation_uri(text)) throw ConfigError({text + ": expected sim:SITE?key=value&..."});
  SimulationUri uri;
  const std::size_t question = text.find('?');
  uri.site = text.substr(4, question == std::string::npos ? question : question - 4);
  if (uri.site.empty()) throw ConfigError({text + ": names no site"});
  std::size_t start = question;
  while (start != std::string::npos) {
    const std::size_t end = text.find('&', start + 1);
    const std::string part =
        text.substr(start + 1, end == std::string::npos ? end : end - start - 1);
    if (!part.empty()) uri.settings.push_back(part);
    start = end;
  }
  return uri;
}

void rethrow_of_uri(const SimulationUri& uri, const ConfigError& error) {
  const std::string option = "--set ";
  std::vector<std::string> problems = error.problems();
  for (std::string& problem : problems) {
    if (problem.starts_with(option))
      problem = "sim:" + uri.site + "?" + problem.substr(option.size());
  }
  throw ConfigError(problems);
}

}  // namespace understory
