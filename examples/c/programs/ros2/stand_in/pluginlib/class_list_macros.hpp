// Stands in for the header of pluginlib, which makes a class loadable by its name.
#pragma once
#include <memory>

#define PLUGINLIB_EXPORT_CLASS(component, interface)                                               \
    std::unique_ptr<interface> make_component();                                                   \
    std::unique_ptr<interface> make_component() { return std::make_unique<component>(); }
