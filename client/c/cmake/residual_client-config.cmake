# Install to lib/cmake/residual_client beside lib/libresidual_client.so and include/residual_client.h; then
#   find_package(residual_client REQUIRED)
#   target_link_libraries(program PRIVATE residual_client::residual_client)
get_filename_component(_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
if(NOT TARGET residual_client::residual_client)
  add_library(residual_client::residual_client SHARED IMPORTED)
  set_target_properties(residual_client::residual_client PROPERTIES
    IMPORTED_LOCATION "${_prefix}/lib/libresidual_client.so"
    IMPORTED_NO_SONAME TRUE
    INTERFACE_INCLUDE_DIRECTORIES "${_prefix}/include")
endif()
unset(_prefix)
