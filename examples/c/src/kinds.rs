//! Numbers that a field may have, each with its name as text.

/// Makes the constants of one field, and the function that names them.
macro_rules! kinds {
    ($(#[$of:meta])* $function:ident: $type:ty;
        $($(#[$doc:meta])* $name:ident = $value:literal, $text:literal;)*) => {
        $($(#[$doc])* pub const $name: $type = $value;)*

        $(#[$of])*
        #[unsafe(no_mangle)]
        pub const extern "C" fn $function(kind: $type) -> *const core::ffi::c_char {
            let name: &core::ffi::CStr = match kind {
                $($value => $text,)*
                _ => c"?",
            };
            name.as_ptr()
        }

        #[cfg(test)]
        mod $function {
            #[test]
            fn a_name_is_the_end_of_its_constant() {
                let name = |kind| {
                    // SAFETY: the function returns one of the literals above.
                    unsafe { core::ffi::CStr::from_ptr(super::$function(kind)) }.to_str().unwrap()
                };
                for (constant, kind) in [$((stringify!($name), $value)),*] {
                    assert!(constant.to_lowercase().ends_with(&format!("_{}", name(kind))));
                }
                assert_eq!(name(254), "?");
            }
        }
    };
}
