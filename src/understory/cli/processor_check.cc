// Packages and the usual build need a processor of the level x86-64-v3. On an older one the program
// would end with "illegal instruction". This file alone is compiled for every processor
// (CMakeLists.txt), and its check comes before all other code of the program. It uses nothing that
// is compiled for newer processors.
#if defined(__x86_64__) && defined(UNDERSTORY_LEVEL)
#include <cpuid.h>
#include <unistd.h>

#include <cstring>

namespace understory {
namespace {

// As shells answer for a program that is there and cannot be run.
constexpr int kExitCannotRun = 126;

// What compilers have no name for in common: bits of ECX by CPUID 1 and CPUID 80000001h.
constexpr unsigned kMovbe = 1u << 22;
constexpr unsigned kLzcnt = 1u << 5;

struct Feature {
  int level;  // of the x86-64 psABI, from which on processors have it
  bool present;
  const char* name;
};

void say(const char* text) {
  // What could be done if standard error is closed?
  [[maybe_unused]] const ssize_t written = write(STDERR_FILENO, text, std::strlen(text));
}

// The tests of the compiler include whether the system keeps the wide registers.
void check_processor() {
  __builtin_cpu_init();
  unsigned eax = 0, ebx = 0, basic = 0, extended = 0, edx = 0;
  __get_cpuid(1, &eax, &ebx, &basic, &edx);
  __get_cpuid(0x80000001, &eax, &ebx, &extended, &edx);
  const Feature features[] = {
      {2, __builtin_cpu_supports("ssse3") != 0, "SSSE3"},
      {2, __builtin_cpu_supports("sse4.2") != 0, "SSE4.2"},
      {2, __builtin_cpu_supports("popcnt") != 0, "POPCNT"},
      {3, __builtin_cpu_supports("avx2") != 0, "AVX2"},
      {3, __builtin_cpu_supports("fma") != 0, "FMA"},
      {3, __builtin_cpu_supports("bmi2") != 0, "BMI2"},
      {3, (basic & kMovbe) != 0, "MOVBE"},
      {3, (extended & kLzcnt) != 0, "LZCNT"},
      {4, __builtin_cpu_supports("avx512f") != 0, "AVX512F"},
      {4, __builtin_cpu_supports("avx512vl") != 0, "AVX512VL"},
      {4, __builtin_cpu_supports("avx512bw") != 0, "AVX512BW"},
      {4, __builtin_cpu_supports("avx512dq") != 0, "AVX512DQ"},
  };
  const char* separator =
      "error: this program is built for processors of the level " UNDERSTORY_LEVEL
      ", and this one lacks ";
  bool lacks = false;
  for (const Feature& feature : features) {
    if (feature.level > UNDERSTORY_LEVEL_NUMBER || feature.present) continue;
    say(separator);
    say(feature.name);
    separator = ", ";
    lacks = true;
  }
  if (!lacks) return;
  say("; build it on this machine (./run build), or for all processors (./run package --march "
      "none)\n");
  _exit(kExitCannotRun);
}

// Before the constructors of all other files, which may hold any instruction.
[[gnu::constructor(101)]] void check_first() {
  check_processor();
}

}  // namespace
}  // namespace understory
#endif
