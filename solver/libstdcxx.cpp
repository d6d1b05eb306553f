// A part of std::string that libstdc++ has since GCC 13 only: with a copy here the module runs with older versions too.
#include <string>

#if defined(_GLIBCXX_RELEASE) && _GLIBCXX_RELEASE >= 13 && _GLIBCXX_USE_CXX11_ABI
template void std::string::_M_replace_cold(char*, std::size_t, const char*, std::size_t, std::size_t);
#endif
