//! The reasons of the readers are rows of `spec/messages.json`, with the same severity and with the values that the text names.

use map3d_base::Reason;
use map3d_base::reason::Message;
use serde_json::Value;

#[test]
fn reasons_are_rows_of_the_specification() {
    let rows: Value = serde_json::from_str(include_str!("../../../spec/messages.json")).expect("JSON");
    for reason in Reason::ALL {
        let row = &rows[reason.code()];
        assert_eq!(row["severity"], format!("{:?}", reason.severity()).to_lowercase(), "{}", reason.code());
        assert_eq!(row["names_files"] == true, reason.names_files(), "{}", reason.code());
    }
}

#[test]
fn an_error_names_the_reason_in_words() {
    assert_eq!(Message::from(Reason::RingNotClosed).to_string(), "ring not closed");
    assert_eq!(Reason::ImagePixelsOverLimit.with("limit", 5).to_string(), "image pixels over limit (limit 5)");
}
