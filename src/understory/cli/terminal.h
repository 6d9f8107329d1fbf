#pragma once

#include <initializer_list>
#include <string>

#include "understory/util/log.h"
#include "understory/util/progress.h"

namespace understory {

// Messages on stderr: "warning: ...", "error: ..."; debug messages only if `verbose`.
[[nodiscard]] Log::Sink terminal_log(bool verbose, bool quiet);

// Progress on stderr: one line that is rewritten on a terminal, a line every ten seconds otherwise,
// with rate and remaining time.
[[nodiscard]] ProgressSink terminal_progress(bool quiet);

// Makes Ctrl-C (and SIGTERM) ask for a clean end; a second one ends the program at once.
[[nodiscard]] StopRequested install_stop_handler();
// From now on the first one does, with the exit code of a stopped command: for commands that leave
// no files.
void stop_at_once();

// Numbers side by side, with so many decimals: "0.120, -0.003, 0.000".
[[nodiscard]] std::string number_row(std::initializer_list<double> values, int decimals,
                                     const char* separator);

}  // namespace understory
