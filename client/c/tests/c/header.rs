//! The header that is checked in is that of the code.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::fs;
use std::path::Path;

#[test]
fn the_header_is_that_of_the_code() {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut generated = Vec::new();
    cbindgen::generate(package).unwrap().write(&mut generated);
    let generated = String::from_utf8(generated).unwrap();
    let path = package.join("include/residual_client.h");
    if std::env::var_os("RESIDUAL_WRITE_GENERATED").is_some() {
        fs::write(&path, &generated).unwrap();
    }
    let header = fs::read_to_string(&path).unwrap_or_default();
    assert!(
        header == generated,
        "{} is not that of the code; run `RESIDUAL_WRITE_GENERATED=1 cargo test -p residual-client-c --test c`",
        path.display()
    );
}
