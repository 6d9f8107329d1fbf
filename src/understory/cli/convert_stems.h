#pragma once

#include <string>

#include "understory/cli/command.h"
#include "understory/recording/finding.h"
#include "understory/recording/recording.h"
#include "understory/util/log.h"

namespace understory {

// Whether an output is a table of stems: its name ends in .csv.gz.
[[nodiscard]] bool is_stems_file(const std::string& output);

// Writes the stems of each scan of a recording, as seen from where the body was. The motion within
// a scan is not taken out. Of a cloud (.las, .laz, .ply, .pcd), which is a map, it writes the stems
// of that. Returns the exit code. Throws InputError where there is none.
[[nodiscard]] int convert_to_stems(const std::string& input, const std::string& output,
                                   const OpenOptions& open, bool overwrite,
                                   CommandContext& context);

// Puts the output of a conversion in place. Returns the exit code: kExitUntrusted where the output
// is partial, because Ctrl-C stopped it or the input is damaged. What a stopped conversion wrote
// does not replace a former output.
template <typename Staged>
[[nodiscard]] int commit_conversion(Staged& staged, bool stopped, const std::string& output,
                                    CommandContext& context) {
  const bool keep = stopped && staged.replaces();
  if (!keep) staged.commit();
  if (stopped)
    context.log.warn("convert.stopped",
                     keep ? "stopped before the end: " + output + " is left as it was"
                          : "stopped before the end: the output is partial");
  std::string damage = found(context.log, Finding::kDamage).first;
  if (damage.empty()) damage = found(context.log, Finding::kCutOff).first;
  if (!damage.empty() && !keep)
    context.log.warn("convert.damaged",
                     "the input is damaged, so the output is partial: " + damage);
  return stopped || !damage.empty() ? kExitUntrusted : kExitDone;
}

}  // namespace understory
