//! The reasons of the readers are rows of `spec/messages.json`, with the same severity and with the values that the text names.

use map3d_base::Reason;
use map3d_base::reason::{MESSAGES, Message};
use serde_json::Value;

#[test]
fn reasons_are_rows_of_the_specification() {
    let rows: Value = serde_json::from_str(MESSAGES).expect("JSON");
    for reason in Reason::ALL {
        let row = &rows[reason.code()];
        assert_eq!(row["severity"], format!("{:?}", reason.severity()).to_lowercase(), "{}", reason.code());
    }
}

#[test]
fn every_reason_has_an_english_text() {
    for reason in Reason::ALL {
        let text = Message::from(*reason).to_string();
        assert!(text.ends_with('.') && !text.contains("{count}"), "{}: {text}", reason.code());
    }
    assert_eq!(Reason::ImagePixelsOverLimit.with("limit", 5).to_string(), "Textures of more than 5 pixels: 1.");
}
