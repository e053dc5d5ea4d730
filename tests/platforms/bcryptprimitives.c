/* Wine 8.0 has no bcryptprimitives.dll, of which Rust's standard library wants this function. */
#include <windows.h>
#include <ntsecapi.h>

__declspec(dllexport) BOOL ProcessPrng(PBYTE data, SIZE_T length) {
    return RtlGenRandom(data, (ULONG)length);
}
