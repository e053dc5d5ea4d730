//! fmi2Instantiate: where resources lie, and which are refused.

use crate::host::staircase::RESOURCE;
use crate::host::*;
use fmu_abi::types::*;
use std::ffi::{CStr, CString};
use std::fs;
use std::ptr::{null, null_mut};

/// Tries to make an instance; the messages are those of the logger, which is switched off.
fn attempt(name: Text, kind: Choice, guid: Text, uri: Text) -> Result<(), String> {
    let messages = Messages::default();
    let callbacks = callbacks(&messages);
    let c = unsafe { fmi2Instantiate(name, kind, guid, uri, &callbacks, 0, 0) };
    let messages = messages.into_inner().unwrap();
    if c.is_null() {
        assert_eq!(messages.len(), 1, "one sentence: {messages:?}");
        let (status, category, text) = &messages[0];
        assert_eq!(
            (*status, category.as_str()),
            (Status::Error, "logStatusError")
        );
        let reason = text.strip_prefix("fmi2Instantiate: ").unwrap();
        return Err(reason.to_string());
    }
    assert!(messages.is_empty(), "silent when off: {messages:?}");
    unsafe { fmi2FreeInstance(c) };
    Ok(())
}

fn instantiate(resources: &Resources, guid: &CStr) -> Result<(), String> {
    attempt(
        c"x".as_ptr(),
        CO_SIMULATION,
        guid.as_ptr(),
        resources.uri().as_ptr(),
    )
}

#[test]
fn all_spellings_of_the_location_work() {
    let resources = Resources::new(0.1);
    let folder = resources.folder.path().join("sub dir é 100% #1");
    fs::create_dir(&folder).unwrap();
    fs::copy(
        resources.folder.path().join(RESOURCE),
        folder.join(RESOURCE),
    )
    .unwrap();
    let plain = folder.to_str().unwrap();
    let encoded = plain
        .replace('%', "%25")
        .replace(' ', "%20")
        .replace('é', "%C3%A9")
        .replace('#', "%23");
    for path in [plain, encoded.as_str()] {
        for prefix in [
            "file://",
            "file:",
            "file:///",
            "FILE://",
            "file://localhost",
            "",
        ] {
            for end in ["", "/"] {
                let uri = CString::new(format!("{prefix}{path}{end}")).unwrap();
                let guid = resources.guid.as_ptr();
                let made = attempt(c"x".as_ptr(), CO_SIMULATION, guid, uri.as_ptr());
                assert_eq!(made, Ok(()), "{uri:?}");
            }
        }
    }
}

#[test]
fn arguments_that_make_no_sense_are_refused_in_a_sentence() {
    let resources = Resources::new(0.1);
    let uri = resources.uri();
    let (name, guid, uri) = (c"x".as_ptr(), resources.guid.as_ptr(), uri.as_ptr());
    let not_utf8 = c"\xff\xfe".as_ptr();
    let cases = [
        (null(), CO_SIMULATION, guid, uri, "instanceName"),
        (c"".as_ptr(), CO_SIMULATION, guid, uri, "instanceName"),
        (c" \t".as_ptr(), CO_SIMULATION, guid, uri, "instanceName"),
        (name, 0, guid, uri, "model exchange"),
        (name, -7, guid, uri, "model exchange"),
        (
            name,
            CO_SIMULATION,
            null(),
            uri,
            "fmuGUID is a null pointer",
        ),
        (name, CO_SIMULATION, not_utf8, uri, "fmuGUID is not UTF-8"),
        (
            name,
            CO_SIMULATION,
            guid,
            null(),
            "fmuResourceLocation is a null pointer",
        ),
        (name, CO_SIMULATION, guid, not_utf8, "not UTF-8"),
        (
            name,
            CO_SIMULATION,
            guid,
            c"http://host/x".as_ptr(),
            "no file URI",
        ),
        (name, CO_SIMULATION, guid, c"".as_ptr(), "cannot read"),
        (
            name,
            CO_SIMULATION,
            guid,
            c"file:".as_ptr(),
            "names no folder",
        ),
        (
            name,
            CO_SIMULATION,
            guid,
            c"file:///no/such/folder".as_ptr(),
            "cannot read",
        ),
        (
            name,
            CO_SIMULATION,
            guid,
            c"file:///%ff".as_ptr(),
            "not UTF-8 when decoded",
        ),
        (name, CO_SIMULATION, c"{0}".as_ptr(), uri, "{0}"),
        (
            name,
            CO_SIMULATION,
            c"".as_ptr(),
            uri,
            "does not belong to this FMU",
        ),
    ];
    for (name, kind, guid, uri, expected) in cases {
        let reason = attempt(name, kind, guid, uri).unwrap_err();
        assert!(reason.contains(expected), "{expected}: {reason}");
    }
    let without = unsafe { fmi2Instantiate(name, CO_SIMULATION, guid, uri, null(), 0, 0) };
    assert_eq!(without, null_mut());
}

#[test]
fn a_name_that_is_not_utf8_is_no_obstacle() {
    let resources = Resources::new(0.1);
    let (guid, uri) = (resources.guid.as_ptr(), resources.uri());
    assert_eq!(
        attempt(c"\xff".as_ptr(), CO_SIMULATION, guid, uri.as_ptr()),
        Ok(())
    );
}

#[test]
fn damaged_truncated_missing_and_foreign_resources_are_refused() {
    let resources = Resources::new(0.1);
    let path = resources.folder.path().join(RESOURCE);
    let good = fs::read(&path).unwrap();
    for at in 0..good.len() * 8 {
        let mut damaged = good.clone();
        damaged[at / 8] ^= 1 << (at % 8);
        fs::write(&path, damaged).unwrap();
        let reason = instantiate(&resources, &resources.guid).unwrap_err();
        assert!(reason.contains("does not belong to this FMU"), "{reason}");
    }
    for length in 0..good.len() {
        fs::write(&path, &good[..length]).unwrap();
        assert!(instantiate(&resources, &resources.guid).is_err());
    }
    fs::remove_file(&path).unwrap();
    let reason = instantiate(&resources, &resources.guid).unwrap_err();
    assert!(
        reason.contains("cannot read") && reason.contains(RESOURCE),
        "{reason}"
    );
    fs::create_dir(&path).unwrap();
    assert!(instantiate(&resources, &resources.guid).is_err());
    fs::remove_dir(&path).unwrap();
    fs::write(&path, good).unwrap();
    assert_eq!(instantiate(&resources, &resources.guid), Ok(()));
    let other_binary = model_description::guid("another", b"0.1");
    let reason = instantiate(&resources, &CString::new(other_binary).unwrap()).unwrap_err();
    assert!(reason.contains("staircase"), "{reason}");
}

#[test]
fn a_resource_that_belongs_but_makes_no_sense_is_refused() {
    let resources = Resources::new(0.1);
    for (text, expected) in [
        ("", "no sample time"),
        ("NaN", "must be positive"),
        ("-1", "must be"),
    ] {
        fs::write(resources.folder.path().join(RESOURCE), text).unwrap();
        let guid = model_description::guid(staircase::IDENTIFIER, text.as_bytes());
        let reason = instantiate(&resources, &CString::new(guid).unwrap()).unwrap_err();
        assert!(reason.contains(expected), "{reason}");
    }
}
