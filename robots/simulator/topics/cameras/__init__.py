"""The cameras' topics. Pictures are drawn on one separate thread, only while they have subscribers."""
